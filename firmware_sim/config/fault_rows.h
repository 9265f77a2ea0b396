/* SPDX-License-Identifier: MIT */
/* Rows of injected faults, for the table of a configuration and for that of a scenario, which has nothing else. Define
 * FAULT_LIST_AT(member) before including this file: a member's place in struct fault_list. Private to keys.c and
 * faults.c. */
/* clang-format off */
#define FAULT_MEMBER(member) CFG_MEMBER(struct fault, member)
#define FAULT(member)        "faults[]." #member, FAULT_MEMBER(member)

    {"faults", .type = CFG_LIST, .min = 0, .max = FAULT_MAX, .offset = FAULT_LIST_AT(fault),
     .size = sizeof(struct fault), .count_offset = FAULT_LIST_AT(n),
     .help = "Faults to inject, the same way each time. The record is in the file of --truth, and in the journal."},
    {"faults[]", .type = CFG_MAP, .help = "A fault. Keys that its kind doesn't have are refused."},
    {FAULT(kind), CFG_ENUM, .example = "drop", .names = fault_names,
     .help = "On the wire, at a frame: drop, duplicate, reorder, delay, jitter, truncate, flip, stall, split, merge, "
             "garbage, disconnect, unplug, cable, usb_reset, endpoint_stall, short_packets; at a reply: no_reply, "
             "late_reply, wrong_reply, echo; at a connection: refuse, slow_enumeration, descriptor_length. All other "
             "kinds are in the head, and change the measurement, what the head says of the time, its boots and power, "
             "or its counters."},
    {FAULT(link), CFG_COUNT, NULL, "0", 0, CONFIG_MAX_LINKS,
     .help = "Number of the link, in the order of links, from 1; 0: all links that can have the fault."},
    {FAULT(of), CFG_ENUM, .def = "stream", .names = (const char *const[]){"stream", "notices", NULL},
     .help = "Which stream frames are counted, and hit. stream: those that are the same at any pace; notices: "
             "telemetry, events and repetitions. All units of other protocols count as stream."},
    {FAULT(at), CFG_COUNT, NULL, "0", 0, 1e15,
     .help = "At this frame (reply, connection) alone, counted from 1 in each session (connections: on the link). 0: "
             "not used; from, until and every apply."},
    {FAULT(from), CFG_COUNT, NULL, "1", 1, 1e15,
     .help = "From this frame (reply, connection) on, counted in the same way."},
    {FAULT(until), CFG_COUNT, NULL, "0", 0, 1e15,
     .help = "Up to this frame (reply, connection), included; 0: without end."},
    {FAULT(every), CFG_COUNT, NULL, "1", 1, 1e15, .help = "At every n-th, beginning with `from`."},
    {FAULT(probability), CFG_REAL, NULL, "1", 0, 1, .help = "Random choice: the share of the frames that the other "
                                                            "keys select."},
    {FAULT(count), CFG_COUNT, NULL, "0", 0, 1e15,
     .help = "Largest number of times; 0: no limit. It counts in each session. At connections, and for disconnect, "
             "unplug, cable, usb_reset, endpoint_stall and short_packets, it counts on the link."},
    {FAULT(from_pulse), CFG_COUNT, NULL, "0", 0, 1e17,
     .help = "From this pulse of a scan on, counted from 0. A fault of frames then hits only frames of points."},
    {FAULT(until_pulse), CFG_COUNT, NULL, "", 0, 1e17, .example = "1000000",
     .help = "Up to this pulse of a scan, included; when not given, without end."},
    {FAULT(from_s), CFG_REAL, "s", "0", 0, 1e8,
     .help = "From this device time on, since power-up (FAULt:ADD: since the command)."},
    {FAULT(until_s), CFG_REAL, "s", "0", 0, 1e8, .help = "Before this device time; 0: without end."},
    {FAULT(seed), CFG_COUNT, NULL, "1", 0, 18446744073709551615.0,
     .help = "Seed of its random numbers. They also depend on its place in the list and on the link."},
    {FAULT(n), CFG_COUNT, NULL, "0", 0, 1e9,
     .help = "Number. duplicate: additional copies, up to 100; reorder: most frames that overtake it, up to 1000; "
             "truncate: missing bytes, up to 1e6 (0: a random number); flip: bits, up to 1000; split: writes, up to 64; "
             "merge: frames, up to 64; garbage: bytes, up to 1024; short_packets: transfers, up to 1e6; "
             "descriptor_length: additional bytes, up to 1000; counters_high: counts below the wrap. 0 stands "
             "for 2 with split and merge, for 16 with garbage, and for 1 with all others but truncate."},
    {FAULT(byte), CFG_COUNT, NULL, "", 0, 1e9, .example = "30",
     .help = "flip: byte of the frame whose bits are changed, counted from 0; when not given, any byte."},
    {FAULT(reseal), CFG_BOOL, .def = "off",
     .help = "flip: the checksums are corrected afterwards, so that readers can't detect the fault by them. Then only "
             "measured data are changed; in native frames the payload. Without reseal a datagram (udp) is not sent: "
             "its reader's system would drop it."},
    {FAULT(for_ms), CFG_REAL, "ms", "0", 0, 1e8,
     .help = "Duration; jitter: the largest one. A fault on the wire lasts that long by the clock, one in the head by device "
             "time. "
             "pps_jitter: how late every second pulse is, up to 400; nmea_late: how late sentences are, up to 5000, and "
             "several together up to 10000."},
    {FAULT(reset), CFG_BOOL, .def = "off",
     .help = "cable: connections are reset once it is plugged in again; else they go on."},
    {FAULT(factor), CFG_REAL, NULL, "0.5", 0.01, 2, .help = "mirror_slow: the mirror's speed is multiplied by it."},
    {FAULT(deg), CFG_REAL, "deg", "1", -180, 180,
     .help = "pan_slip: how much farther the beam goes than the encoder; mirror_wobble: largest deviation to either "
             "side."},
    {FAULT(hz), CFG_REAL, "Hz", "10", 0.01, 1000, .help = "mirror_wobble: how often per second."},
    {FAULT(loss_db), CFG_REAL, "dB", "3", 0, 60,
     .help = "window_soiled: loss of optical power, both ways together."},
    {FAULT(jump_s), CFG_REAL, "s", "1", -1e6, 1e6, .help = "clock_jump: how much the time of day goes forward; "
                                                           "ntp_step: how far the server is ahead; below 0: back."},
    {FAULT(ppm), CFG_REAL, "ppm", "100", -1e5, 1e5,
     .help = "clock_drift: how fast the time of day gains; ptp_lost, ptp_no_sync, ptp_faulty: the same, in holdover."},
    {FAULT(ns), CFG_REAL, "ns", "1000", -1e15, 1e15,
     .help = "ptp_grandmaster, ptp_step: how far the master's time is ahead of the true time; ptp_asymmetry: how much "
             "longer the way from the master is than the mean of both ways; ptp_jitter: largest deviation of a "
             "measurement to either side, up to 1e9."},
    {FAULT(grandmaster), CFG_COUNT, NULL, "0x00b0aefffe000002", 1, 18446744073709551615.0, .flags = CFG_HEX,
     .allowed = "0x1 to 0xffffffffffffffff", .help = "ptp_grandmaster: its identity, an EUI-64."},
    {FAULT(clock_class), CFG_COUNT, NULL, "6", 0, 255, .help = "ptp_grandmaster: its clock class by IEEE 1588."},
#undef FAULT
#undef FAULT_MEMBER
#undef FAULT_LIST_AT
    /* clang-format on */
