"""Who walks there: seen in pictures and echoes, followed, and told from things."""
