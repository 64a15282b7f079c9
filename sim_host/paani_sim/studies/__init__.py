"""Tables that compare the simulator and the estimators with the literature and with truth."""
