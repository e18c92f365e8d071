"""From MuJoCo contacts to waves on the touched surfaces, and back."""
