/* SPDX-License-Identifier: MIT */
/* Rows of the table of keys: from the beam to the instrument. Private to keys.c, whose macros they are written with. */
/* clang-format off */
    {"beam", .type = CFG_MAP, .help = "The footprint of the pulses."},
    {KEY(beam.mode), CFG_ENUM, .def = "single",
     WORDS([BEAM_SINGLE] = "single", [BEAM_RINGS] = "rings", [BEAM_ADAPTIVE] = "adaptive", [BEAM_AUTO] = "auto"),
     .help = "single: one ray per pulse; rings: sub-rays over the footprint; adaptive: sub-rays where the footprint "
             "reaches over an edge, or onto glass or a mirror; auto: as `scanhead plan` says."},
    {KEY(beam.rings), CFG_COUNT, NULL, "4", 0, BEAM_MAX_RINGS,
     .help = "Rings of sub-rays: n rings have 1 + 3 n (n + 1). At a plane's end a range is wrong by up to 0.35 / "
             "n^0.75 of the footprint's radius times the tangent of the incidence: 9 mm with 4 rings, 0.35 mrad, "
             "100 m and 77 deg. Outlines are exact. In the mode adaptive the rings are for footprints on glass or "
             "mirrors, and for those with more edges than that mode can tell apart."},
    {"beam.echoes", SETTING(echoes), CFG_ENUM, .def = "all",
     WORDS([BEAM_ALL] = "all", [BEAM_FIRST] = "first", [BEAM_LAST] = "last", [BEAM_STRONGEST] = "strongest"),
     .help = "Which echoes of a pulse are sent. Echoes of glass and of surfaces behind it are among them."},

    {"cast", .type = CFG_MAP, .help = "How rays find the surfaces that they hit."},
    {KEY(cast.sight), CFG_ENUM, .def = "auto",
     WORDS([CHOICE_AUTO] = "auto", [CHOICE_OFF] = "off", [CHOICE_ON] = "on"),
     .help = "on: before a scan the head makes a visibility map of its station and looks rays up in it. This works "
             "only where head and beam stand still, the beam is not rings, and no texture cuts holes. Copies of "
             "meshes rule it out, unless a page needs them as triangles. Hits are the same, to the last bit. "
             "off: each ray goes to the BVH. auto: on where the map saves more time than it takes, as `scanhead plan` "
             "says."},
    {KEY(cast.sight_mib), CFG_REAL, "MiB", "64", 1, 65536,
     .help = "Memory that the maps of all stations may take together, also while they are made. Rays in directions "
             "that don't fit go to the BVH."},

    {"coverage", .type = CFG_MAP, .help = "How `scanhead coverage` cuts the scene's surface."},
    {KEY(coverage.cell_m), CFG_REAL, "m", "0.25", 1e-4, 1e4,
     .help = "Size of a cell. A cell is seen where a pulse hits it, so it should be several times as wide as the "
             "distance between points."},
    {KEY(coverage.memory_mib), CFG_REAL, "MiB", "2048", 1, 1048576,
     .help = "Memory that cells, or a mesh of them, may take. Cells that need more are refused."},

    {"plan", .type = CFG_MAP,
     .help = "Tolerances. Each stage uses the cheapest method that keeps them (`scanhead plan`)."},
    {"plan.tolerance_m", IN_CONFIG(plan.range_m), CFG_REAL, "m", "1e-3", 1e-6, 1,
     .help = "RMS error of the echo ranges, compared with a footprint of 1,000 sub-rays."},
    {"plan.echo_tolerance", IN_CONFIG(plan.echo_share), CFG_REAL, NULL, "1e-3", 1e-4, 1,
     .help = "Share of the pulses that may have another number of echoes than with 1,000 sub-rays. The plan's sample "
             "is too small to show smaller shares than 1e-3."},

    {"noise", .type = CFG_MAP, .help = "Noise of the measurement."},
    {KEY(noise.range), CFG_ENUM, .def = "off",
     WORDS([RANGE_NOISE_OFF] = "off", [RANGE_NOISE_ON] = "on", [RANGE_NOISE_SIGNAL] = "signal"),
     .help = "Range noise. on: the profile's range_sigma_m and ppm, for any target; signal: range_sigma_m holds at "
             "range_sigma_at_m, and noise grows as the signal gets weaker (signal.model: on); off: exact ranges."},
    {KEY(noise.sigma_m), CFG_REAL, "m", "@range_sigma_m", 0, 10,
     .help = "One sigma of the range noise, its fixed part, in place of the profile's range_sigma_m. With a signal "
             "model at least the profile's range_sigma_floor_m."},
    {KEY(noise.angle), CFG_BOOL, .def = "off",
     .help = "Angle noise of the profile's mirror_sigma_deg and pan_sigma_deg: the beam deviates, the encoders do not "
             "show it."},
    {KEY(noise.seed), CFG_COUNT, NULL, "1", 0, 18446744073709551615.0,
     .help = "Seed of the random numbers. Noise also differs by station, and by scan since power-up at a station."},
    {"noise.ball", .type = CFG_MAP, .help = "Ball-shaped noise: each point moves to anywhere in a ball around it."},
    {KEY(noise.ball.radius_m), CFG_REAL, "m", "0", 0, 100, .help = "Radius of the ball; 0: none."},
    {KEY(noise.ball.distance_1_m), CFG_REAL, "1/m", "0", 0, 100,
     .help = "The radius grows by this share of itself per metre of range."},
    {KEY(noise.ball.factor), CFG_VEC3, NULL, "[1, 1, 1]", 0, 1000,
     .help = "Factors that stretch the ball along its axes."},
    {"noise.ball.axes", IN_CONFIG(noise.ball.local), CFG_ENUM, .def = "scene", WORDS("scene", "beam"),
     .help = "Axes of the ball: x, y, z of the scene; or of the beam: along it, to the right, up."},
    {KEY(noise.ball.seed), CFG_COUNT, NULL, "", 0, 18446744073709551615.0, .example = "1",
     .help = "Seed of the ball's random numbers; noise.seed when not given."},

    {"signal", .type = CFG_MAP, .help = "The returned signal: amplitude, reflectance, detection threshold."},
    {"signal.model", IN_CONFIG(signal.on), CFG_BOOL, .def = "off",
     .help = "on: amplitude by the range equation, reflectance in the points, and targets beyond the profile's "
             "reaches are not detected; off: each hit within the head's ranges is an echo, without reflectance."},
    {"signal.detection", IN_CONFIG(signal.sharp), CFG_ENUM, .def = "noisy", WORDS("noisy", "sharp"),
     .help = "noisy: detection is random near the threshold, half of the pulses at the profile's reach; sharp: all "
             "pulses up to the reach, none beyond."},
    {KEY(signal.reflectance), CFG_REAL, NULL, "0.5", 0, 1,
     .help = "Reflectance of surfaces that have no texture or colour in the mesh and no reflectance in surfaces."},
    {KEY(signal.visibility_m), CFG_REAL, "m", "0", 0, 1e6,
     .help = "Visibility of the air, for its extinction at the profile's wavelength; 0: the visibility of the "
             "profile's reaches."},
    {KEY(signal.extinction_1_km), CFG_REAL, "1/km", "", 0, 1000, .example = "0.5",
     .help = "Extinction of the air (absorption and scattering), in place of visibility_m."},

    {"waveform", .type = CFG_MAP,
     .help = "Full waveforms: the light that comes back of a pulse, over time, as a digitiser samples it. They "
             "need signal.model: on. The outgoing pulse has the profile's pulse_width_ns. The noise of a sample is the "
             "threshold over the profile's threshold_snr; with signal.detection: sharp there is none."},
    {"waveform.send", SETTING(waves), CFG_ENUM, .def = "off", WORDS([0] = "off", [1] = "on"),
     .help = "on: frames with the samples follow the points, on links of protocol native. Clients may switch them off "
             "and on again (SCAN:WAVeform)."},
    {KEY(waveform.echoes), CFG_ENUM, .def = "model",
     WORDS([WAVE_ECHOES_MODEL] = "model", [WAVE_ECHOES_THRESHOLD] = "threshold", [WAVE_ECHOES_FRACTION] = "fraction",
           [WAVE_ECHOES_GAUSSIANS] = "gaussians"),
     .help = "Source of the echoes. model: closed forms of signal and noise. The other words find echoes in the "
             "samples, with their noise. threshold: where the signal crosses a level; fraction: at half of the peak; "
             "gaussians: by decomposition into Gaussian pulses."},
    {KEY(waveform.pulse), CFG_ENUM, .def = "gaussian",
     WORDS([WAVEFORM_GAUSSIAN] = "gaussian", [WAVEFORM_ASYMMETRIC] = "asymmetric", [WAVEFORM_TABLE] = "table"),
     .help = "Shape of the outgoing pulse: symmetric; asymmetric, with a longer fall (skew); or measured "
             "(pulse_file)."},
    {KEY(waveform.pulse_file), CFG_PATH, .def = "", .example = "pulse.csv",
     .help = "pulse: table: a CSV with the columns t_ns,power: the power at times that are equally far apart."},
    {KEY(waveform.skew), CFG_REAL, NULL, "1.5", 1, 3,
     .help = "pulse: asymmetric: the time in which the pulse falls, over the time in which it rises. The larger it is, "
             "the finer sample_ns must be: up to 0.37 of the pulse's width with 1.5, 0.2 with 2, 0.09 with 3."},
    {KEY(waveform.bandwidth_mhz), CFG_REAL, "MHz", "0", 0, 100000,
     .help = "Bandwidth of the receiver, at -3 dB, from 1 on; 0: no limit. It lowers the pulse's peak, and with it the "
             "level of waveform.echoes, but not the noise. If that level is below 5 times the noise, many echoes are "
             "of noise alone."},
    {KEY(waveform.sample_ns), CFG_REAL, "ns", "1", 0.05, 100,
     .help = "Time from sample to sample, in whole picoseconds."},
    {KEY(waveform.bits), CFG_COUNT, NULL, "12", 8, 14, .help = "Bits of a sample."},
    {KEY(waveform.baseline_counts), CFG_REAL, NULL, "32", 0, 8191.5,
     .help = "The count without any light, in steps of 1/16, up to half of the largest count: 2047.5 with 12 bits."},
    {KEY(waveform.full_scale_db), CFG_REAL, "dB", "30", 0, 90,
     .help = "Signal at the largest count, above the detection threshold. A stronger signal is cut off there."},
    {KEY(waveform.saturation_db), CFG_REAL, "dB", "0", 0, 90,
     .help = "The receiver gives no more than this signal, above the threshold; 0: no limit."},
    {KEY(waveform.dead_ns), CFG_REAL, "ns", "0", 0, 100000,
     .help = "The receiver gives nothing for this time after a sample at saturation_db, which must be given, too."},
    {KEY(waveform.keep_db), CFG_REAL, "dB", "-6", -60, 60,
     .help = "Samples are kept in windows where the signal reaches this, relative to the threshold."},
    {KEY(waveform.before_ns), CFG_REAL, "ns", "5", 0, 4000,
     .help = "A window begins this long before the signal reaches keep_db. before_ns and after_ns together are up to "
             "2048 samples."},
    {KEY(waveform.after_ns), CFG_REAL, "ns", "10", 0, 4000,
     .help = "A window ends this long after the signal has fallen below keep_db."},
    {KEY(waveform.near_m), CFG_REAL, "m", "0", 0, 1e5,
     .help = "With far_m: one window from this range on, for every pulse, whatever comes back."},
    {KEY(waveform.far_m), CFG_REAL, "m", "0", 0, 1e5,
     .help = "The window of near_m ends here; 0: windows lie around returns."},

    {"surfaces", .type = CFG_LIST, .min = 0, .max = CONFIG_MAX_SURFACES, LIST_OF(surface, n_surfaces),
     .help = "Properties of surfaces, by name. The first entry that fits counts; members that it leaves out have "
             "their defaults."},
    {"surfaces[]", .type = CFG_MAP, .help = "An entry."},
    {RULE(material), CFG_TEXT, .def = "*",
     .help = "Material's name. * stands for any characters and ? for one; \\* and \\? are the characters themselves."},
    {RULE(object), CFG_TEXT, .def = "*", .help = "Object's name, with the same wildcards."},
    {SURFACE(reflectance), CFG_REAL, NULL, "", 0, 1, .example = "0.4",
     .help = "Lambertian reflectance; 0 absorbs. When not given: luminance of the mesh's texture or colour."},
    {SURFACE(specular), CFG_REAL, NULL, "", 0, 1, .example = "0.1", .help = "Share that is reflected in a lobe."},
    {SURFACE(gloss), CFG_REAL, NULL, "", 0, 1e6, .example = "100",
     .help = "Exponent of the lobe's cosine; 100 when not given."},
    {SURFACE(retro), CFG_REAL, NULL, "", 0, 1e6, .example = "300",
     .help = "Retro-reflector: its signal is that of a white target times this, at any incidence; foils have 100 to "
             "1000."},
    {SURFACE(glass), CFG_REAL, NULL, "", 0, 1, .example = "0.9",
     .help = "Share of the power that passes through each surface. Both the pane and the surface behind it give "
             "echoes. The share counts on the way there and back: behind two surfaces (a pane) of 0.9 an echo has "
             "0.9^4 of its power."},
    {SURFACE(mirror), CFG_REAL, NULL, "", 0, 1, .example = "0.9",
     .help = "Share of the power that is mirrored. It gives ghost points, which have labels of their own. The share "
             "counts on the way there and back: in a mirror of 0.9 an echo has 0.81 of its power."},

    {"optics", .type = CFG_MAP, .help = "Pulses that hit glass or a mirror."},
    {KEY(optics.depth), CFG_COUNT, NULL, "4", 0, CAST_MAX_DEPTH,
     .help = "Largest number of such surfaces on the way of a pulse; 0: glass and mirrors are like other surfaces. "
             "When not given: as many as `scanhead plan` finds necessary."},

    {"instrument", .type = CFG_MAP,
     .help = "Errors of the head's geometry (core/instrument.h). The beam follows the mechanics with these errors; "
             "points are computed as if there were no errors."},
#define ANGLE(name, text) {KEY(instrument.name), CFG_REAL, "deg", "0", -10, 10, .help = text}
    ANGLE(collimation_deg, "The beam points to the right of the plane perpendicular to the mirror's axis."),
    ANGLE(trunnion_deg, "The mirror's axis is not level: its right end is lower by this angle."),
    {KEY(instrument.transit_offset_m), CFG_REAL, "m", "0", -1, 1,
     .help = "The mirror's axis passes this far ahead of the pan's axis."},
    {KEY(instrument.mirror_offset_m), CFG_REAL, "m", "0", -1, 1,
     .help = "The beam leaves this far to the right of the pan's axis."},
    ANGLE(mirror_index_deg, "The line encoder reads too much by this."),
    {KEY(instrument.mirror_scale_ppm), CFG_REAL, "ppm", "0", -1e4, 1e4,
     .help = "The line encoder reads too much by this share of the angle."},
    ANGLE(mirror_eccentricity_deg, "The line encoder reads too much by this times sin(angle - mirror_phase_deg)."),
    {KEY(instrument.mirror_phase_deg), CFG_REAL, "deg", "0", -360, 360, .help = "Phase of the eccentricity."},
    ANGLE(pan_index_deg, "The pan encoder reads too much by this."),
    {KEY(instrument.pan_scale_ppm), CFG_REAL, "ppm", "0", -1e4, 1e4,
     .help = "The pan encoder reads too much by this share of the angle."},
    ANGLE(pan_eccentricity_deg, "The pan encoder reads too much by this times sin(angle - pan_phase_deg)."),
    {KEY(instrument.pan_phase_deg), CFG_REAL, "deg", "0", -360, 360, .help = "Phase of the eccentricity."},
    {KEY(instrument.range_offset_m), CFG_REAL, "m", "0", -10, 10, .help = "Measured ranges are too long by this."},
    {KEY(instrument.range_scale_ppm), CFG_REAL, "ppm", "0", -1e4, 1e4,
     .help = "Measured ranges are too long by this share: a clock that runs too fast."},
    /* clang-format on */
