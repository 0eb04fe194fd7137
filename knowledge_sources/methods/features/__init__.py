"""What is in a picture: lines, regions, corners, template correlation."""
