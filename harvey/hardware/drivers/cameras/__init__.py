"""Drivers of cameras and video files."""
