"""Fingers to other programs: ROS 2 and Foxglove.

    link thread --on_sample--> queue --> Outlet.publish          one thread, in order
                               Board --> Outlet.report           once a second

Each outlet is a module and an extra of its own. What they share is in `run` and `values`: reading a hand,
stamps, diagnoses, tare. A finger notices nothing of it: everything runs on the host.
"""
