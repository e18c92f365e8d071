"""What the solver's speed is measured against, from the bound of the machine's memory to the code one writes first."""
