"""Fingers to other programs: ROS 2 and Foxglove.

    link thread --on_sample--> queue --> Outlet.publish          one thread, in order
                               Board --> Outlet.report           once a second

Each outlet is a separate module and extra. Common code is in `run` and `values`: reading a hand,
stamps, diagnoses, tare. Everything runs on the host; fingers are not affected.
"""
