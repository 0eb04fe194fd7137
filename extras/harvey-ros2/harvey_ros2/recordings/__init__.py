"""What somebody else recorded: bags, films, folders of pictures with odometry."""
