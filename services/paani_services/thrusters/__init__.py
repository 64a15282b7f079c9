"""Thrusters of a hull: the thrust adapter's decision to the microcontroller that drives the speed controllers."""
