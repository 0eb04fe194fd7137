"""IndoorGML (OGC 14-005) building files."""
