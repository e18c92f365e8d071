"""The command line: one typed function a command, errors as one line, pictures and reports of an atlas."""
