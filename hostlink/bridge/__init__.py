"""Fingers to other programs: ROS 2, Foxglove, and robots of LeRobot's.

    link thread --on_sample, on_detail--> queue --> Outlet.publish          one thread, in order
                                          Board --> Outlet.report           once a second

Each outlet has its extra: `ros` (a node: `ros_node`; messages: `ros_messages`; parameters: `ros_parameters`)
and `foxglove`. Common code is in `run` and `values`: reading a hand, stamps, diagnoses, tare, parameters.
`lerobot` is no outlet: a robot asks it. Everything runs on the host; fingers are not affected.
"""
