"""The command line: one typed class per command, errors as one line, reports of an atlas."""
