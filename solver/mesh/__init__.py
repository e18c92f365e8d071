"""Triangle meshes: reading files, mending what is safe to mend, refusing what is no genus-0 surface."""
