"""IFC (ISO 16739) building files."""
