"""What is advised on annotated pictures: beside people and vessels, on what is no water, and on open water."""
