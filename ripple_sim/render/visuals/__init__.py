"""What a MuJoCo model shows: geoms, sites, materials, textures, lights."""
