"""From a text to acts: words, clauses, what they ask to do and to see. No building is asked."""
