"""What a person drives: the command line. It stands on the lab and knows no shader."""
