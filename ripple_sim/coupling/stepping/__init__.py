"""Physics steps as the waves follow them: which have passed, whether their forces are known, and other people's."""
