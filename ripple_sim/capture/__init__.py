"""From a running simulation to frames: snapshots, shutter, exposure, camera."""
