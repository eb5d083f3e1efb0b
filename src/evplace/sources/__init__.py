"""Where a drive comes from: recordings, tracks, films, simulated events; and back to files."""
