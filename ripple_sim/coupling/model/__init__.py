"""What a MuJoCo model says about its targets, computed once."""
