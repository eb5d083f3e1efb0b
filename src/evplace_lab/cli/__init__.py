"""The commands of the laboratory: see `evplace.cli`."""
