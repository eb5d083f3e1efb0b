"""Event recordings -> packets of checked events."""
