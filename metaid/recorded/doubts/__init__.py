"""What a log may have wrong and a model may lack: facts that are named, and systematic deviations."""
