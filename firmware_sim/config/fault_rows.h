/* Rows of faults, for the table of a configuration and for that of a scenario, which has nothing else. Before it is
 * included, FAULT_LIST_AT(member) says where a member of struct fault_list is. Private to keys.c and faults.c. */
/* clang-format off */
#define FAULT_MEMBER(member) CFG_MEMBER(struct fault, member)
#define FAULT(member)        "faults[]." #member, FAULT_MEMBER(member)

    {"faults", .type = CFG_LIST, .min = 0, .max = FAULT_MAX, .offset = FAULT_LIST_AT(fault),
     .size = sizeof(struct fault), .count_offset = FAULT_LIST_AT(n),
     .help = "What goes wrong on request, the same way each time. Each is told with --truth, and in the journal."},
    {"faults[]", .type = CFG_MAP, .help = "A fault. Keys that its kind doesn't have are refused."},
    {FAULT(kind), CFG_ENUM, .example = "drop", .names = fault_names,
     .help = "On the wire, at a frame: drop, duplicate, reorder, delay, jitter, truncate, flip, stall, split, merge, "
             "garbage, disconnect, unplug, usb_reset, endpoint_stall, short_packets; at a reply: no_reply, late_reply, "
             "wrong_reply, echo; at a connection: refuse, slow_enumeration, descriptor_length. The others are in the "
             "head, and change what is measured."},
    {FAULT(link), CFG_COUNT, NULL, "0", 0, CONFIG_MAX_LINKS,
     .help = "Number of the link, in the order of links, from 1; 0: all that can have it."},
    {FAULT(of), CFG_ENUM, .def = "stream", .names = (const char *const[]){"stream", "notices", NULL},
     .help = "Which frames are counted, and hit. stream: those that are the same at any pace; notices: telemetry, events and "
             "repetitions. Units of other protocols are all stream."},
    {FAULT(at), CFG_COUNT, NULL, "0", 0, 1e15,
     .help = "At this frame (reply, connection) alone, counted from 1 in each session (connections: on the link)."},
    {FAULT(from), CFG_COUNT, NULL, "1", 1, 1e15, .help = "From this one on, counted in the same way."},
    {FAULT(until), CFG_COUNT, NULL, "0", 0, 1e15, .help = "Up to this one, included; 0: without end."},
    {FAULT(every), CFG_COUNT, NULL, "1", 1, 1e15, .help = "At every n-th, beginning with `from`."},
    {FAULT(probability), CFG_REAL, NULL, "1", 0, 1, .help = "By chance, of those that the other keys leave."},
    {FAULT(count), CFG_COUNT, NULL, "0", 0, 1e15,
     .help = "At most so many times in a session (disconnect, unplug, usb_reset, endpoint_stall, short_packets, and at "
             "connections: on the link); 0: no limit."},
    {FAULT(from_pulse), CFG_COUNT, NULL, "0", 0, 1e17,
     .help = "From this pulse of a scan on, counted from 0. Then only frames of points are hit."},
    {FAULT(until_pulse), CFG_COUNT, NULL, "", 0, 1e17, .example = "1000000", .help = "Up to this pulse."},
    {FAULT(from_s), CFG_REAL, "s", "0", 0, 1e8, .help = "From this device time on, since power-up (FAULt:ADD: since the command)."},
    {FAULT(until_s), CFG_REAL, "s", "0", 0, 1e8, .help = "Before this device time; 0: without end."},
    {FAULT(seed), CFG_COUNT, NULL, "1", 0, 18446744073709551615.0,
     .help = "Seed of its random numbers. Its place in the list and the link count, too."},
    {FAULT(n), CFG_COUNT, NULL, "0", 0, 1e9,
     .help = "How many: duplicate: copies more; reorder: frames that overtake it, at most; truncate: bytes that are missing "
             "(0: any number); flip: bits; split: writes; merge: frames; garbage: bytes; short_packets: transfers; "
             "descriptor_length: bytes; counters_high: counts. 0: 1; split and merge 2, garbage 16."},
    {FAULT(byte), CFG_COUNT, NULL, "", 0, 1e9, .example = "30", .help = "flip: bits of this byte, from 0; when not given, any."},
    {FAULT(reseal), CFG_BOOL, .def = "off",
     .help = "flip: the checksums are made right again, so that no reader can see it by them. What is measured is hit "
             "then, of native frames the payload. Without it a datagram (udp) is not sent: its reader's system would "
             "drop it."},
    {FAULT(for_ms), CFG_REAL, "ms", "0", 0, 1e8,
     .help = "How long; jitter: at most. Of the clock on the wire, of device time in the head."},
    {FAULT(factor), CFG_REAL, NULL, "0.5", 0.01, 2, .help = "mirror_slow: its speed, as a share of the right one."},
    {FAULT(deg), CFG_REAL, "deg", "1", -180, 180, .help = "pan_slip: by so much; mirror_wobble: at most, to either side."},
    {FAULT(hz), CFG_REAL, "Hz", "10", 0.01, 1000, .help = "mirror_wobble: times per second."},
    {FAULT(loss_db), CFG_REAL, "dB", "3", 0, 60, .help = "window_soiled: loss of the echoes, on the way there and back."},
    {FAULT(jump_s), CFG_REAL, "s", "1", -1e6, 1e6, .help = "clock_jump: by so much."},
    {FAULT(ppm), CFG_REAL, "ppm", "100", -1e5, 1e5, .help = "clock_drift: it gains so much."},
#undef FAULT
#undef FAULT_MEMBER
#undef FAULT_LIST_AT
/* clang-format on */
