"""MuJoCo's contacts with targets: normal forces, and where they act."""
