"""Whatever lies at a path, as one drive: a recording or a film with its track; and its traverse."""
