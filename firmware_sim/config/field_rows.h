/* SPDX-License-Identifier: MIT */
/* Rows of the table of keys: monitored fields. Private to keys.c, whose macros they are written with. */
/* clang-format off */
    {"fields", .type = CFG_LIST, .min = 0, .max = CONFIG_MAX_FIELDS, LIST_OF(field, n_fields), .flags = CFG_SPECIAL,
     .help = "Monitored fields of SICK scanners, for links that speak cola: a TiM7xx has 16 sets of three fields, an "
             "LMS1xx ten fields. Clients can read them, write others and get their results."},
    {"fields[]", .type = CFG_MAP, .help = "A field. Edges and corners belong to it."},
    {FIELD(number), CFG_COUNT, NULL, NULL, 1, CONFIG_MAX_FIELDS, .example = "1",
     .help = "Number, as clients count from 1: telegrams call it field000. TiM7xx: 1 to 3 are the first set, 4 to 6 "
             "the second."},
    {FIELD(name), CFG_TEXT, .def = "", .example = "door", .flags = CFG_ASCII, .help = "Name, for clients."},
    {FIELD(shape), CFG_ENUM, .example = "polygon",
     WORDS([FIELD_POLYGON] = "polygon", [FIELD_SEGMENT] = "segment", [FIELD_RECTANGLE] = "rectangle"),
     .help = "polygon: points_m; segment: angles_deg, radii_m; rectangle: corner_m, size_m, turn_deg."},
    {FIELD(points_m), CFG_POINTS, "m", "", -1000, 1000, .example = "[[-1, 0.5], [1, 0.5], [1, 3], [-1, 3]]",
     .flags = CFG_NEEDED,
     .help = "polygon: its corners, 3 to 62, as x (right) and y (forward) from the head. It may be concave, and may have "
             "the head inside."},
    {FIELD(angles_deg), CFG_PAIR, "deg", "", -360, 720, .example = "[45, 135]",
     .help = "segment: from the first angle counter-clockwise to the second, at most a turn; 0 right, 90 forward. 350 "
             "to 370 goes across 0."},
    {FIELD(radii_m), CFG_PAIR, "m", "", 0, 1000, .example = "[0, 3]",
     .help = "segment: its inner and outer radius; an inner one of 0 begins at the head."},
    {FIELD(corner_m), CFG_PAIR, "m", "", -1000, 1000, .example = "[-1, 0.5]",
     .help = "rectangle: x and y of the corner that it is turned about: its left rear corner before the turn."},
    {FIELD(size_m), CFG_PAIR, "m", "", 0.001, 1000, .example = "[2, 2.5]",
     .help = "rectangle: width to the right and length forward from its corner."},
    {FIELD(turn_deg), CFG_REAL, "deg", "0", -360, 360,
     .help = "rectangle: it is turned about its corner, counter-clockwise seen from above."},
    {FIELD(response_ms), CFG_COUNT, "ms", "0", 0, 120000,
     .help = "Response time: an object must stay at one place for this long. The time is rounded to whole scans in "
             "a row, at least one: 134 ms at 15 Hz are two scans."},
    {FIELD(blanking_m), CFG_REAL, "m", "0", 0, 1000,
     .help = "Objects narrower than this are ignored. An object's width is the number of its neighbouring beams in the "
             "field, times the angle step, times their smallest range."},
    {FIELD(output), CFG_COUNT, NULL, "0", 0, 3,
     .help = "LMS1xx: the digital output that is active while the field is infringed; 0: none. Several fields may "
             "share one. TiM7xx: the first field of a set has output 1, and so on."},
    {"inputs", .type = CFG_LIST, .min = 0, .max = CONFIG_MAX_INPUTS, LIST_OF(input, n_inputs), .flags = CFG_SPECIAL,
     .help = "Digital inputs of a SICK scanner, for links that speak cola: when they are active. In a TiM7xx they choose "
             "the set of fields. They are the bits of a number, input 1 is its lowest bit; the set is one more than "
             "that number."},
    {"inputs[]", .type = CFG_MAP, .help = "A time in which an input is active. An input may have several."},
    {INPUT(input), CFG_COUNT, NULL, NULL, 1, 4, .example = "1", .help = "Number of the input."},
    {INPUT(from_s), CFG_REAL, "s", "0", 0, 1e8, .help = "It begins at this device time, counted since power-up."},
    {INPUT(until_s), CFG_REAL, "s", "1e8", 0, 1e8, .help = "It ends at this device time."},
    /* clang-format on */
