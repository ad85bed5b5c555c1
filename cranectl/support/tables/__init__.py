"""Read columns of numbers from text and Parquet files: references and measured logs have one reader."""
