"""What is said of an estimate: the verdict, curves, JSON, and files with the error of each."""
