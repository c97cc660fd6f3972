"""What is known of a study before any trial, as `metaid study check` prints it; see `determined`, which loads more."""
