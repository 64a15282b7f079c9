"""What all trainings share: the loop, augmentation, warm starts, recipes, export."""
