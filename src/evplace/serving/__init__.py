"""Where am I, now: a live source, a localizer, and what tells the world of its answers.

source -> Feed (checks, records, holds) -> Drive (localizer, clock) -> Report -> page, JSON, NMEA, ROS 2
"""
