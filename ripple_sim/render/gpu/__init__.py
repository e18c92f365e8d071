"""Resources on the GPU: buffers, uniform blocks, textures, read-back."""
