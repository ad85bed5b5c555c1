"""Effects on the MuJoCo plant: each changes the model's specification by name, a file an effect."""
