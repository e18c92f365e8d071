"""Triangle meshes: reading files, mending what is safe to mend, refusing surfaces that are not of genus 0."""
