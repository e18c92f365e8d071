"""Triangle meshes: read from files, cleaned, cut to manifold sheets, repaired or wrapped on request."""
