"""The GPU's resources: the contract with the shaders, uniform block, G-buffer, textures, read-back."""
