"""One estimate of a vehicle's errors and of its targets: a bounded smoother with a live filter between its solves.

Signs: every error is *reported minus true* (`errors`). Times are seconds from an epoch that the caller chooses, one for
all streams. World: north, east and height (up) in metres about the origin. A ray is a unit direction in the axes of the
carrier (the body; with a gimbal its camera), as the configuration's mount says.

Input, in order of time:

    estimator = Estimator(priors, noise)
    estimator.add_attitude(t, quaternion)                 # (4,) w x y z, ned_from_body, as stamped
    estimator.add_gimbal_attitude(t, quaternion)          # with priors of 15: about the vehicle's heading, or north
    estimator.add_range(reading, foot)                    # a rangefinder's height of the camera, m north and east
    estimator.carrier.path.add_accuracy(t, sigma_m)       # the receiver's own accuracy from now on
    estimator.add_position(t, position, velocity)         # (3,) north, east, height; (3,) m/s; reset=True at a jump
    frame = frame_of(number, stamps, rays, tangents)      # D detections; `tangents` standardise: noise of one each axis

Each frame:

    estimator.begin(t)                                    # the live filter by the priors, until the first solve
    prediction = estimator.predict(frame, targets, alike) # None without a possible pair
    prediction.target, .residual, .covariance, .distance2 # detections against the targets that they may be of
    begin_target(estimator.live, number, sighting, moving=False)  # one that no other explains
    estimator.update(frame.with_targets(numbers), teaches) # new and moving targets do not teach
    found = cluster(model, carrier, s, shared, covariance, error, turn)  # which mount lets the sights meet

A solve is a pure function of what was kept at its instant:

    if estimator.is_solve_due(now):
        task = estimator.start_solve(now)                 # a copy: the estimator may go on
        solution = task.run()                             # in line, or in a thread; `task.slices()` in bounded pieces
        estimator.adopt(solution)                         # at a fixed later instant; frames between are replayed

Output:

    estimator.answer(target, t) -> TargetAnswer                 # place, relative place, their covariances, velocity
    estimator.self_calibration() -> tuple[ParameterStatus, ...]   # calibrated | waiting | contradicts, with sigmas
    estimator.stored() / with_stored(priors, stored)      # the vehicle's own parameters for the next flight
"""
