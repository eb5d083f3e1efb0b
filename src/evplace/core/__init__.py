"""What all other parts stand on: events, errors, settings, storage, families of parts, work in processes."""
