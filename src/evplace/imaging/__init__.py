"""Events, or frames -> windows -> images -> a traverse."""
