"""What figures show over a picture: a field in colours, contacts, the texel grid, time, energy; two runs at once."""
