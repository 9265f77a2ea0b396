-- SPDX-License-Identifier: MIT
-- scanhead's native protocol in Wireshark and tshark: drivers/protocol/PROTOCOL.md and its pages, byte by byte.
--
--     wireshark -X lua_script:scanhead.lua scan.pcapng
--
-- One file, so that a copy of it is all that Wireshark needs. From top to bottom: checksum, tables of fields, sequence
-- numbers, state of the stream, items of the tree, the search for frames, carriers.
--
-- Facts from earlier packets (sequence, scales, anchor, replies) are found when a packet is seen for the first time,
-- and kept by packet. So the same packet always shows the same. Written for Lua 5.2 and later.

-- The script may be loaded twice: installed, and named on the command line. Only the first one registers the protocol.
-- For a name that it does not know, Dissector.get returns nil or raises an error.
local is_asked, known = pcall(Dissector.get, "scanhead")
if is_asked and known then return end

local scanhead = Proto("scanhead", "Scan head")
local HEADER_LEN, MOST_PAYLOAD, MOST_REPLY, MOST_COMMAND, SYNC = 28, 65536, 512, 256, 0xd5
local TYPES = {"Descriptor", "Anchor", "Points", "Line end", "Telemetry", "Event", "Surfaces", "Poses", "Attributes",
               "Emitter", "Colours", "Waveforms"}
local DESCRIPTOR, ANCHOR, POINTS, LINE_END, TELEMETRY, EVENT, SURFACES, POSES, ATTRIBUTES, EMITTER, COLOURS, WAVES =
  1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12
local STATES = {[0] = "off", "boot", "idle", "spin-up", "scanning", "spin-down", "fault"}
local unpack_bytes, byte, floor = Struct.unpack, string.byte, math.floor

-- ---- CRC-32C. Four bytes a step: two tables of 65536 for the lower and the upper half of a word.

local native = load("return function(a, b) return a ~ b end") -- from Lua 5.3 on
local bxor = native and native() or bit32.bxor
local low_half, high_half

local function make_tables()
  local one = {}
  for i = 0, 255 do
    local c = i
    for _ = 1, 8 do c = c % 2 == 1 and bxor((c - 1) / 2, 0x82f63b78) or c / 2 end
    one[i] = c
  end
  local tables = {one, {}, {}, {}} -- the byte and then 0, 1, 2, 3 zeros
  for k = 2, 4 do
    for i = 0, 255 do
      local c = tables[k - 1][i]
      tables[k][i] = bxor(one[c % 256], (c - c % 256) / 256)
    end
  end
  low_half, high_half = {}, {}
  for i = 0, 255 do
    for k = 0, 255 do
      low_half[256 * i + k] = bxor(tables[4][k], tables[3][i])
      high_half[256 * i + k] = bxor(tables[2][k], tables[1][i])
    end
  end
end

-- The CRC of n bytes of a string from position `at`, counted from 0.
local function crc32c(bytes, at, n)
  if not low_half then make_tables() end
  local low, high, crc = low_half, high_half, 0xffffffff
  local i, last = at + 1, at + n
  while i + 15 <= last do
    local a, b, c, d = unpack_bytes("<I4I4I4I4", bytes, i)
    crc = bxor(crc, a)
    local half = crc % 65536
    crc = bxor(bxor(low[half], high[(crc - half) / 65536]), b)
    half = crc % 65536
    crc = bxor(bxor(low[half], high[(crc - half) / 65536]), c)
    half = crc % 65536
    crc = bxor(bxor(low[half], high[(crc - half) / 65536]), d)
    half = crc % 65536
    crc = bxor(low[half], high[(crc - half) / 65536])
    i = i + 16
  end
  while i <= last do -- high[256 * b] is the table of single bytes
    local c = bxor(crc, byte(bytes, i))
    crc = bxor(high[256 * (c % 256)], (crc - crc % 256) / 256)
    i = i + 1
  end
  return bxor(crc, 0xffffffff)
end

-- ---- fields

local F, field_list = {}, {}
local function add_field(name, make, ...)
  local field = make("scanhead." .. name, ...)
  F[name], field_list[#field_list + 1] = field, field
  return field
end

local function whole(make)
  return function(abbr, title, extra)
    if type(extra) == "string" then return make(abbr, title, base.UNIT_STRING, {" " .. extra}) end
    return make(abbr, title, base.DEC, extra)
  end
end
-- Wireshark 4.0 shows no units of doubles: put_real appends them.
local units = {}
local function real(unit)
  return function(abbr, title, extra)
    local field = ProtoField.double(abbr, title)
    units[field] = unit or extra
    return field
  end
end
local function put_real(tree, field, range, value, unit)
  local item = tree:add(field, range, value)
  unit = unit or units[field]
  if unit then item:append_text(unit == "°" and unit or " " .. unit) end
  return item
end

-- Nanoseconds, signed, as Wireshark's time.
local function time_of(ns)
  local s = ns / 1000000000
  return NSTime.new(s:tonumber(), (ns - s * 1000000000):tonumber())
end

-- A kind: its length on the wire, its field in Wireshark, and a function that reads its value where Wireshark's own
-- reading would not do.
local function micro(range) return range:le_uint64():tonumber() / 1e6 end
local function signed_micro(range) return range:le_int64():tonumber() / 1e6 end
local KINDS = {
  u8 = {1, whole(ProtoField.uint8)},
  u16 = {2, whole(ProtoField.uint16)},
  u32 = {4, whole(ProtoField.uint32)},
  i32 = {4, whole(ProtoField.int32)},
  i64 = {8, whole(ProtoField.int64)},
  u64 = {8, whole(ProtoField.uint64)},
  hex = {4, function(abbr, title) return ProtoField.uint32(abbr, title, base.HEX) end},
  zero = {4, function(abbr, title) return ProtoField.uint32(abbr, title, base.HEX) end},
  zero8 = {1, function(abbr, title) return ProtoField.uint8(abbr, title, base.HEX) end},
  f32 = {4, real()},
  f64 = {8, real()},
  counts16 = {2, real("counts"), function(range) return range:le_uint() / 16 end},
  hz = {8, real("Hz"), micro},
  deg = {8, real("°"), signed_micro},
  deg_s = {8, real("°/s"), micro},
  deg32 = {4, real("°"), function(range) return range:le_int() / 1e6 end},
  s = {8, ProtoField.relative_time, function(range) return time_of(range:le_int64()) end},
  ms = {4, ProtoField.relative_time, function(range)
    local ms = range:le_uint()
    return NSTime.new(floor(ms / 1000), ms % 1000 * 1000000)
  end},
  utc = {8, function(abbr, title) return ProtoField.absolute_time(abbr, title, base.UTC) end,
         function(range) return time_of(range:le_int64()) end},
  eui64 = {8, function(abbr, title) return ProtoField.uint64(abbr, title, base.HEX) end},
  text = {nil, ProtoField.string},
}

-- A table of the protocol's pages: {name, kind, title, unit or names of values, count}. The fourth entry of a text is
-- its width; that of `hex` is the lowest value with a reserved bit.
local function rows_of(prefix, rows)
  local at = 0
  for _, row in ipairs(rows) do
    local kind = KINDS[row[2]]
    row.name, row.kind, row.at, row.count = row[1], row[2], at, row[5] or 1
    row.size = kind[1] or row[4]
    row.value, row.is_real = kind[3], row.kind:find("^f") or row.kind:find("^deg") or row.kind == "hz" or
      row.kind == "counts16"
    row.known = row.kind:find("^zero") and 1 or row.kind == "hex" and row[4] or nil
    row.field = add_field(prefix .. row.name, kind[2], row[3], not row.known and row.kind ~= "text" and row[4] or nil)
    at = at + row.size * row.count
  end
  rows.len = at
  return rows
end

local function rows_beside_points(prefix)
  return rows_of(prefix, {{"pulse0", "u64", "First pulse"}, {"line", "u32", "Line"}, {"n_points", "u32", "Points"}})
end

local YES_NO = {"yes", "no"}
local PTP_PORTS = {[0] = "none", "INITIALIZING", "FAULTY", [4] = "LISTENING", [8] = "UNCALIBRATED", [9] = "SLAVE"}
local PTP_SERVOS = {[0] = "s0, unlocked", "s1, jump", "s2, locked"}
local ROWS = {
  [DESCRIPTOR] = rows_of("descriptor.", {
    {"idn", "text", "Identity", 96}, {"profile", "text", "Profile", 32},
    {"layout", "u32", "Layout of points", {[0] = "polar", "geo"}}, {"isa", "u32", "Rays cast at once", "rays"},
    {"prr_hz", "hz", "Pulse rate"}, {"lines_hz", "hz", "Lines per second"}, {"pan_deg_s", "deg_s", "Pan speed"},
    {"fov_min_deg", "deg", "Sweep starts at"}, {"sweep_deg", "deg", "Whole sweep"},
    {"line_start_deg", "deg", "Cast from line angle"}, {"line_stop_deg", "deg", "Cast up to line angle"},
    {"pan_start_deg", "deg", "Pan starts at"}, {"pan_stop_deg", "deg", "Pan stops at"},
    {"mirror_counts_per_turn", "f64", "Mirror counts per turn"}, {"pan_counts_per_turn", "f64", "Pan counts per turn"},
    {"range_scale_m", "f64", "Range per count", "m"}, {"range_min_m", "f64", "Smallest range", "m"},
    {"range_max_m", "f64", "Largest range", "m"}, {"max_echoes", "u32", "Most echoes of a pulse"},
    {"n_surfaces", "u32", "Surfaces"}, {"frames", "u32", "Pan sweeps of the scan (0: endless)"},
    {"scan", "u32", "Scan"}, {"seed", "u64", "Seed of random numbers"}}),
  content = rows_of("descriptor.", {{"content", "hex", "Content", 16}, {"reserved", "zero", "Reserved"}}),
  [ANCHOR] = rows_of("anchor.", {
    {"crs", "u32", "CRS", {[0] = "local (scene frame)", "ECEF", "UTM or UPS", "geodetic"}},
    {"epsg", "u32", "EPSG code"},
    {"station", "u32", "Station"}, {"moving", "hex", "Moving", 4},
    {"x", "f64", "Anchor x, m, or latitude, °"}, {"y", "f64", "Anchor y, m, or longitude, °"},
    {"z", "f64", "Anchor z", "m"},
    {"scale_m", "f64", "A count is at most", "m"}, {"lat_deg", "f64", "Latitude", "°"},
    {"lon_deg", "f64", "Longitude", "°"},
    {"height_m", "f64", "Ellipsoidal height", "m"}, {"station_x_m", "f64", "Station x in the scene", "m"},
    {"station_y_m", "f64", "Station y in the scene", "m"}, {"station_z_m", "f64", "Station z in the scene", "m"},
    {"rotation", "f64", "Rotation, head to scene, row by row", nil, 9},
    {"scale", "f64", "Units of the CRS per count of x, y, z (0: as above)", nil, 3},
    {"heights", "u32", "Heights are above", {[0] = "the ellipsoid", "the geoid"}},
    {"until_s", "ms", "For points before (0: all that follow)"},
    {"axes", "f64", "Axes, scene to CRS, row by row (all 0: the same)", nil, 9},
    {"frame", "f64", "Frame scalar of the stop"}}),
  [POINTS] = rows_of("points.", {
    {"frame", "u32", "Pan sweep"}, {"line", "u32", "Line"}, {"pulse0", "u64", "First pulse"},
    {"t0_s", "s", "First pulse fires, since the scan's start"},
    {"line_t0_s", "s", "The line's first pulse fires, since the scan's start"}, {"n_pulses", "u32", "Pulses"},
    {"n_points", "u32", "Points"}}),
  [LINE_END] = rows_of("line_end.", {
    {"frame", "u32", "Pan sweep"}, {"line", "u32", "Line"}, {"pulse0", "u64", "First pulse"},
    {"t0_s", "s", "First pulse fired, since the scan's start"}, {"t1_s", "s", "The next line's first pulse"},
    {"n_fired", "u32", "Fired pulses"}, {"n_cast", "u32", "Cast pulses"}, {"n_echoes", "u32", "Echoes"},
    {"mirror_count", "u32", "Mirror count at the end"}, {"pan_count", "u32", "Pan count at the end"},
    {"status", "hex", "Status", 4}, {"n_crowded", "u32", "Echoes left out: too many of a pulse"},
    {"n_faint", "u32", "Hits not detected"}, {"n_unfit", "u32", "Echoes that do not fit into 32 bits"}}),
  [TELEMETRY] = rows_of("telemetry.", {
    {"state", "u32", "State", STATES}, {"scan", "u32", "Scan"}, {"pulses", "u64", "Pulses delivered"},
    {"echoes", "u64", "Echoes"}, {"lines", "u64", "Lines"}, {"lost_pulses", "u64", "Pulses lost by the head"},
    {"late_blocks", "u64", "Late blocks"}, {"late_max_us", "u32", "Latest block", "µs"},
    {"errors_queued", "u32", "Errors in the queue"},
    {"reader_lost_frames", "u64", "Frames that this reader lost"}, {"utc", "utc", "UTC"},
    {"scan_fired", "u64", "Fired in the scan", "pulses"}, {"scan_cast", "u64", "Cast in the scan", "pulses"},
    {"scan_lost", "u64", "Lost by the head in the scan", "pulses"}}),
  lost_lines = rows_of("telemetry.", {{"lost_lines", "u64", "Lines that the head's files lack"}}),
  ptp = rows_of("telemetry.", {
    {"ptp_port", "u32", "PTP port", PTP_PORTS}, {"ptp_servo", "u32", "PTP servo", PTP_SERVOS},
    {"ptp_offset_ns", "i64", "Offset from the master", "ns"}, {"ptp_delay_ns", "i64", "Mean path delay", "ns"},
    {"ptp_grandmaster", "eui64", "Grandmaster"}, {"ptp_class", "u32", "Its clock class"},
    {"ptp_accuracy", "hex", "Its clock accuracy", 256}, {"ptp_flags", "hex", "PTP flags", 2},
    {"ptp_reserved", "zero", "Reserved"}}),
  [EVENT] = rows_of("event.", {
    {"code", "u32", "Event", {"STATE", "SCAN_START", "SCAN_END", "OVERRUN", "READER_LOST", "CONTROL", "ERROR",
                              "SETTINGS", "POSE_LATE", "PPS", "TIME", "SITE", "PTP"}},
    {"reserved", "zero", "Reserved"}, {"a", "u64", "a"}, {"b", "u64", "b"}, {"c", "u64", "c"},
    {"text", "text", "Text", 96}}),
  [SURFACES] = rows_of("surfaces.", {{"first", "u32", "First label"}, {"count", "u32", "Surfaces"}}),
  [POSES] = rows_of("poses.", {{"n", "u32", "Poses"}, {"reserved", "zero", "Reserved"}}),
  pose = rows_of("pose.", {
    {"t_s", "s", "Time since the scan's start"}, {"x_m", "f64", "x", "m"}, {"y_m", "f64", "y", "m"},
    {"z_m", "f64", "z", "m"},
    {"qw", "f64", "Quaternion w"}, {"qx", "f64", "Quaternion x"}, {"qy", "f64", "Quaternion y"},
    {"qz", "f64", "Quaternion z"}, {"frame", "f64", "Frame scalar"}, {"flags", "hex", "Flags", 8},
    {"reserved", "zero", "Reserved"}}),
  [ATTRIBUTES] = rows_beside_points("attributes."),
  [EMITTER] = rows_of("emitter.", {
    {"kind", "u32", "Kind", {[0] = "line", "planar", "beams", "sphere", "directions"}}, {"n_beams", "u32", "Beams"},
    {"steps", "u32", "Steps of a line"}, {"first_step", "i32", "First step that is cast"},
    {"last_step", "i32", "Last step that is cast"}, {"front_step", "i32", "Step that looks along y"},
    {"turn", "i32", "Turn", {[1] = "clockwise", [-1] = "counter-clockwise"}}, {"rings", "u32", "Rings of a pan sweep"},
    {"sequence_num", "u64", "Firing sequence, numerator", "ns"},
    {"sequence_den", "u64", "Firing sequence, denominator"},
    {"first_ring_deg", "deg", "Elevation of ring 0"},
    {"echoes", "u32", "Echoes sent of a pulse", {[0] = "all", "the first", "the last", "the strongest"}},
    {"gaps", "u32", "Gaps from pole to pole"}}),
  beam = rows_of("beam.", {{"elevation_deg", "deg32", "Elevation"}, {"azimuth_deg", "deg32", "Azimuth"},
                           {"offset_ns", "u32", "Fires after the sequence's first", "ns"}}),
  [COLOURS] = rows_beside_points("colours."),
  [WAVES] = rows_of("waves.", {
    {"pulse0", "u64", "First pulse"}, {"line", "u32", "Line"}, {"n_windows", "u32", "Windows"},
    {"sample_ps", "u32", "Time between samples", "ps"}, {"baseline", "counts16", "Baseline"},
    {"bits", "u8", "Bits of a sample"}, {"reserved", "zero8", "Reserved"},
    {"count_signal", "f32", "Signal of one count", "thresholds"}, {"n_lost", "u32", "Samples lost in the head"}}),
}
-- Bits of a field, as further rows under it: {name, title, mask}.
local function bits(of, prefix, name, list)
  for _, row in ipairs(of) do
    if row.name == name then
      row.bits = {}
      for i, bit in ipairs(list) do
        row.bits[i] = add_field(prefix .. name .. "." .. bit[1], ProtoField.bool, bit[2], 32, YES_NO, bit[3])
      end
    end
  end
end
bits(ROWS.content, "descriptor.", "content",
     {{"attributes", "Attributes follow points", 1}, {"colours", "Colours follow points", 2},
      {"waveforms", "Waveforms follow points", 4}, {"deviations", "Attributes have deviations", 8}})
bits(ROWS[ANCHOR], "anchor.", "moving",
     {{"moves", "The head moves", 1}, {"stop", "It stands at a stop of a trajectory", 2}})
bits(ROWS[LINE_END], "line_end.", "status",
     {{"last", "Last line of the pan sweep", 1}, {"stopped", "The scan was stopped within the line", 2}})
bits(ROWS.pose, "pose.", "flags",
     {{"extrapolated", "Extrapolated", 1}, {"late", "Late: the platform counts as standing still", 2},
      {"none", "None had come yet", 4}})

local GOOD_BAD = {[0] = "Bad", "Good"}
add_field("type", ProtoField.uint8, "Type", base.DEC, TYPES)
add_field("version", ProtoField.uint8, "Version")
add_field("flags", ProtoField.uint8, "Flags", base.HEX)
add_field("flags.repeat", ProtoField.bool, "REPEAT: sent before", 8, YES_NO, 1)
add_field("flags.local", ProtoField.bool, "LOCAL: for this reader alone", 8, YES_NO, 2)
add_field("length", ProtoField.uint32, "Length of the payload", base.UNIT_STRING, {" bytes"})
add_field("seq", ProtoField.uint32, "Sequence number")
add_field("payload_crc", ProtoField.uint32, "CRC of the payload", base.HEX)
add_field("payload_crc.status", ProtoField.uint8, "CRC of the payload is", base.DEC, GOOD_BAD)
add_field("t_s", ProtoField.relative_time, "Device time")
add_field("header_crc", ProtoField.uint32, "CRC of the header", base.HEX)
add_field("header_crc.status", ProtoField.uint8, "CRC of the header is", base.DEC, GOOD_BAD)
local NOTICES = {"gap", "repeated", "late", "restarted"}
local GAP, REPEATED, LATE, RESTARTED = 1, 2, 3, 4
add_field("seq.notice", ProtoField.uint8, "Sequence", base.DEC, NOTICES)
add_field("seq.first_lost", ProtoField.uint32, "First frame missing")
add_field("seq.lost", ProtoField.uint32, "Frames missing before this one")
add_field("seq.lost_so_far", ProtoField.uint64, "Frames missing so far")
add_field("payload", ProtoField.bytes, "Payload")
add_field("unknown", ProtoField.bytes, "Bytes that version 1 does not have")
add_field("bad_bytes", ProtoField.bytes, "Bytes that belong to no frame and no line")
add_field("fragment", ProtoField.bytes, "Part of a frame that goes on in a later packet")
add_field("descriptor_in", ProtoField.framenum, "By the descriptor in")
add_field("anchor_in", ProtoField.framenum, "By the anchor in")
add_field("points_in", ProtoField.framenum, "Of the points in")
add_field("missing_pulses", ProtoField.int64, "Pulses that were delivered and are not in this capture")
add_field("line_end.lost_pulses", ProtoField.int64, "Pulses of the line that the head lost")
add_field("command", ProtoField.string, "Command")
add_field("reply", ProtoField.string, "Reply")
add_field("reply.error", ProtoField.int32, "Error number")
add_field("reply_in", ProtoField.framenum, "Reply in", base.NONE, frametype.RESPONSE)
add_field("command_in", ProtoField.framenum, "Command in", base.NONE, frametype.REQUEST)
add_field("reply_time", ProtoField.relative_time, "Time from command to reply")

add_field("point", ProtoField.none, "Point")
add_field("point.pulse", ProtoField.uint64, "Pulse")
add_field("point.t_s", ProtoField.relative_time, "Fired, since the scan's start")
add_field("point.echo", ProtoField.uint8, "Echo")
add_field("point.echo_count", ProtoField.uint8, "Echoes of the pulse")
add_field("point.label", ProtoField.uint16, "Label")
add_field("point.reflectance_db", real("dB"), "Reflectance")
add_field("point.range_m", real("m"), "Range")
add_field("point.line_deg", real("°"), "Line angle")
add_field("point.pan_deg", real("°"), "Pan angle")
add_field("point.x", real(), "x, or latitude")
add_field("point.y", real(), "y, or longitude")
add_field("point.z", real("m"), "z")
local ATTRIBUTE_FIELDS = {add_field("attribute.amplitude_db", real("dB"), "Amplitude"),
                          add_field("attribute.width_ns", real("ns"), "Width of the echo"),
                          add_field("attribute.deviation", real(), "Deviation of its shape, share of the amplitude")}
local COLOUR_FIELDS = {add_field("colour.red", ProtoField.uint8, "Red"),
                       add_field("colour.green", ProtoField.uint8, "Green"),
                       add_field("colour.blue", ProtoField.uint8, "Blue")}
local WAVE_FIELDS = {}
for i, row in ipairs({{"pulse", ProtoField.uint64, "Pulse"},
                      {"dt_ns", ProtoField.uint32, "Fired after the first pulse of the points"},
                      {"first", ProtoField.uint32, "First sample"}, {"n", ProtoField.uint16, "Samples"},
                      {"range_m", real("m"), "Range of the first sample"},
                      {"line_deg", real("°"), "Line angle"}, {"pan_deg", real("°"), "Pan angle"},
                      {"dx", real(), "Change of x along a metre"}, {"dy", real(), "Change of y along a metre"},
                      {"dz", real(), "Change of z along a metre"}, {"counts", ProtoField.string, "Counts"}}) do
  WAVE_FIELDS[i] = add_field("wave." .. row[1], row[2], row[3])
end
local SURFACE_FIELDS = {add_field("surface.label", ProtoField.uint16, "Label"),
                        add_field("surface.object", ProtoField.string, "Object"),
                        add_field("surface.material", ProtoField.string, "Material")}
scanhead.fields = field_list

local E, expert_list = {}, {}
local function add_expert(name, text, group, severity)
  E[name] = ProtoExpert.new("scanhead." .. name, text, expert.group[group], expert.severity[severity])
  expert_list[#expert_list + 1] = E[name]
end
add_expert("bad_header", "The header's CRC is wrong", "CHECKSUM", "ERROR")
add_expert("bad_payload", "The payload's CRC is wrong", "CHECKSUM", "ERROR")
add_expert("garbage", "Bytes that belong to no frame and no line", "MALFORMED", "ERROR")
add_expert("joined", "Bytes before the first frame: the capture began within one", "SEQUENCE", "NOTE")
add_expert("cut", "The frame is not complete", "MALFORMED", "ERROR")
add_expert("wrong", "The payload is not one of its type", "MALFORMED", "ERROR")
add_expert("version_unknown", "Another version of the protocol", "UNDECODED", "WARN")
add_expert("type_unknown", "A type that version 1 does not have yet", "UNDECODED", "NOTE")
add_expert("longer", "Longer than version 1 has it", "UNDECODED", "NOTE")
add_expert("reserved", "Reserved bits are set", "PROTOCOL", "WARN")
add_expert("gap", "Frames are missing before this one", "SEQUENCE", "WARN")
add_expert("repeated", "A frame that came before: not counted again", "SEQUENCE", "WARN")
add_expert("late", "A frame that was missing, after newer ones: not used", "SEQUENCE", "WARN")
add_expert("restarted", "The sequence begins anew", "SEQUENCE", "WARN")
add_expert("no_anchor", "Points that nobody can place yet: no descriptor or no anchor", "SEQUENCE", "NOTE")
add_expert("no_points", "The points that it belongs to did not come just before", "SEQUENCE", "NOTE")
add_expert("counts", "Counts do not agree", "PROTOCOL", "WARN")
add_expert("missing", "Pulses that were delivered are not in this capture", "SEQUENCE", "WARN")
add_expert("event_warning", "The head is in trouble", "RESPONSE_CODE", "WARN")
add_expert("event_note", "The head reports an error", "RESPONSE_CODE", "NOTE")
add_expert("event_chat", "The head reports", "SEQUENCE", "CHAT")
add_expert("refused", "The head has refused the command", "RESPONSE_CODE", "NOTE")
add_expert("unasked", "A reply without a command", "SEQUENCE", "NOTE")
add_expert("bad_command", "No command line", "MALFORMED", "ERROR")
scanhead.experts = expert_list

scanhead.prefs.port = Pref.uint("TCP port of heads", 5025, "Other ports are found by the first frame on them")
scanhead.prefs.user0 = Pref.bool("Link type 147 (USER0) has frames", true,
                                 "As `scanhead record -o FILE.pcapng` writes them")
scanhead.prefs.most = Pref.uint("Most points shown of a frame", 4000, "Fewer open faster")

-- ---- sequence numbers: LOSSES.md; the same as native_sequence.c

local MODULUS, SEEN, GAPS, GAP_MOST, LATE_RUN = 4294967296, 256, 64, 65536, 256

local function new_sequence() return {seen = {}, n_seen = 0, gap = {}, n_gaps = 0, late_run = 0} end

local function add_gap(s, first, n)
  if n == 0 or n > GAP_MOST then return end
  s.gap[s.n_gaps % GAPS] = {first = first, n = n}
  s.n_gaps = s.n_gaps + 1
end

local function fills_gap(s, seq)
  for i = 0, GAPS - 1 do
    local gap = s.gap[i]
    local before = gap and (seq - gap.first) % MODULUS
    if gap and before < gap.n then
      local n = gap.n
      gap.n = before
      if s.n_gaps % GAPS == i then s.n_gaps = s.n_gaps + 1 end -- entry i holds the first part
      add_gap(s, (seq + 1) % MODULUS, n - before - 1)
      return true
    end
  end
  return false
end

local function is_run(s, seq)
  s.late_run = s.late_run > 0 and seq == (s.last_late + 1) % MODULUS and s.late_run + 1 or 1
  s.last_late = seq
  return s.late_run == LATE_RUN
end

local function look_at_jump(s, h)
  local missing = (h.seq - s.next) % MODULUS
  if missing < MODULUS / 2 then
    add_gap(s, s.next, missing)
    return GAP, s.next, missing
  end
  for i = 1, math.min(SEEN, s.n_seen) do
    if s.seen[(s.n_seen - i) % SEEN] == h.raw then return REPEATED end
  end
  if fills_gap(s, h.seq) and not is_run(s, h.seq) then return LATE end
  s.n_seen, s.n_gaps, s.gap = 0, 0, {}
  return RESTARTED
end

-- Frames are compared by h.raw, bytes 1 to 23 of their headers. Returns the notice: kind, first missing frame, number.
local function take_sequence(s, h)
  if h.is_local then
    if s.last_local == h.raw then return REPEATED end
    s.last_local = h.raw
    return nil
  end
  s.last_local = nil
  local kind, first, n
  if s.next and h.seq ~= s.next then kind, first, n = look_at_jump(s, h) end
  if kind == REPEATED then return kind end
  s.seen[s.n_seen % SEEN] = h.raw
  s.n_seen = s.n_seen + 1
  if kind == LATE then return kind end
  s.late_run, s.next = 0, (h.seq + 1) % MODULUS
  return kind, first, n
end

-- ---- payloads: this finds errors in a payload, as native_decode.c does, and values that later frames need. Positions
-- count from 0, payloads begin at `at`.

local function number_at(bytes, at, format) return (unpack_bytes(format or "<I4", bytes, at + 1)) end
-- Exact up to 2^53.
local function number64(bytes, at)
  local low, high = unpack_bytes("<I4I4", bytes, at + 1)
  return high * MODULUS + low
end
local function signed64(bytes, at)
  local low, high = unpack_bytes("<I4i4", bytes, at + 1)
  return high * MODULUS + low
end

local function wrong_row(rows, bytes, at)
  for _, row in ipairs(rows) do
    local from = at + row.at
    if row.kind == "text" and not bytes:sub(from + 1, from + row.size):find("\0", 1, true) then
      return row.name .. ": a text without NUL"
    end
    for i = 0, row.kind:find("^f") and row.count - 1 or -1 do
      local v = number_at(bytes, from + row.size * i, row.size == 8 and "<d" or "<f")
      if v ~= v or v == math.huge or v == -math.huge then return row.name .. ": not a finite number" end
    end
  end
end

-- Payloads that end with records of one length: where their number is, where they begin, their length.
local LISTS = {[POINTS] = {"points", 36, 40, 20}, [ATTRIBUTES] = {"points", 12, 16, 4},
               [COLOURS] = {"points", 12, 16, 3}, [POSES] = {"poses", 0, 8, 80}, [EMITTER] = {"beams", 4, 64, 12}}
local DEVIATIONS = {"deviations", 12, 16, 6} -- of attributes that have them

local function list_of(h, m) return h.type == ATTRIBUTES and m.has_deviations and DEVIATIONS or LISTS[h.type] end

local function wrong_list(list, bytes, at, len)
  local count, most = number_at(bytes, at + list[2]), floor((len - list[3]) / list[4])
  if count > most then return string.format("%d %s, and room for %d", count, list[1], most) end
end

local function wrong_names(bytes, at, len)
  local first, count = number_at(bytes, at), number_at(bytes, at + 4)
  if count > 0xffff or first > 0xffff - count then return "labels beyond 65534" end
  local to, last = at + 8, at + len
  for _ = 1, 2 * count do
    local n = to < last and byte(bytes, to + 1)
    if not n or to + 1 + n > last then return "shorter than its names" end
    if bytes:sub(to + 2, to + 1 + n):find("\0", 1, true) then return "a NUL in a name" end
    to = to + 1 + n
  end
end

local function wrong_poses(bytes, at, len)
  local n, before = number_at(bytes, at), nil
  local most = floor((len - 8) / 80)
  if n < 2 or n > most then return string.format("%d poses, allowed 2 to %d", n, most) end
  for i = 0, n - 1 do
    local from = at + 8 + 80 * i
    local problem = wrong_row(ROWS.pose, bytes, from)
    if problem then return problem end
    local w, x, y, z = unpack_bytes("<dddd", bytes, from + 33)
    if math.abs(w * w + x * x + y * y + z * z - 1) >= 1e-9 then return "a quaternion that is not of length one" end
    local t = signed64(bytes, from)
    if before and t <= before then return "times that do not rise" end
    before = t
  end
end

local function wrong_waves(bytes, at, len)
  local _, _, n_windows, sample_ps, _, bits, _, signal = unpack_bytes("<I4I4I4I4I2BBf", bytes, at + 5)
  if sample_ps == 0 then return "sample_ps 0" end
  if bits < 8 or bits > 14 then return string.format("bits %d, allowed 8 to 14", bits) end
  if signal <= 0 then return "a count without signal" end
  local from, last = at + 32, at + len
  for _ = 1, n_windows do
    local n = from + 28 <= last and number_at(bytes, from + 12, "<I2") or 0
    if n < 1 or n > 4096 then return string.format("a window of %d samples, allowed 1 to 4096", n) end
    from = from + 28 + 2 * (n + n % 2)
    if from > last then return "shorter than its windows" end
  end
end

local function one_of(what, at_field, most)
  return function(bytes, at)
    local v = number_at(bytes, at + at_field)
    if v > most then return string.format("%s %d, allowed 0 to %d", what, v, most) end
  end
end

local WRONG = {
  [DESCRIPTOR] = function(bytes, at, len)
    local problem = one_of("layout", 128, 1)(bytes, at) or one_of("n_surfaces", 252, 65535)(bytes, at)
    local mirror, pan, range = unpack_bytes("<ddd", bytes, at + 209)
    if not problem and number_at(bytes, at + 128) == 0 and not (mirror >= 1 and pan >= 1 and range > 0) then
      problem = "polar, and without scales"
    end
    return problem
  end,
  [ANCHOR] = function(bytes, at) return one_of("crs", 0, 3)(bytes, at) or one_of("heights", 192, 1)(bytes, at) end,
  [SURFACES] = wrong_names,
  [POSES] = wrong_poses,
  [WAVES] = wrong_waves,
  [EMITTER] = function(bytes, at)
    local turn = number_at(bytes, at + 24, "<i4")
    if number64(bytes, at + 40) == 0 then return "sequence_den 0" end
    if turn ~= 1 and turn ~= -1 then return string.format("turn %d, allowed 1 and -1", turn) end
    return one_of("kind", 0, 4)(bytes, at) or one_of("n_beams", 4, 128)(bytes, at)
  end,
}

local function wrong_payload(h, bytes, at, m)
  local rows = ROWS[h.type]
  if not rows then return nil end
  if h.length < rows.len and not (h.type == TELEMETRY and h.length >= 72) then
    return string.format("%d bytes, allowed %d and more", h.length, rows.len)
  end
  local list = list_of(h, m)
  return h.length >= rows.len and wrong_row(rows, bytes, at) or WRONG[h.type] and WRONG[h.type](bytes, at, h.length) or
    list and wrong_list(list, bytes, at, h.length)
end

-- ---- the state that the stream describes, as drivers/host/state.c follows it

local function forget(flow) flow.descriptor, flow.anchor, flow.emitter = nil, nil, nil end

-- Pulses of a scan are counted from its start on, across gaps, and pulses of a line while no frame is missing.
local function begin_scan(flow, scan)
  flow.scan, flow.line = {number = scan, received = 0}, {pulses = 0, whole = true}
end

-- The device time's eight bytes.
local function time_in(h) return h.raw:sub(16, 23) end

local ABSORB = {
  [DESCRIPTOR] = function(flow, h, bytes, at, m)
    local d = {layout = number_at(bytes, at + 128), scan = number_at(bytes, at + 260), packet = m.packet,
               content = h.length >= 280 and number_at(bytes, at + 272) or 0}
    d.mirror_counts, d.pan_counts, d.range_scale = unpack_bytes("<ddd", bytes, at + 209)
    d.middle = (signed64(bytes, at + 176) + signed64(bytes, at + 184)) / 720e6
    if not (h.is_repeat and flow.descriptor and flow.descriptor.scan == d.scan) then
      forget(flow)
      flow.last_pulse0 = nil
    end
    if flow.scan and flow.scan.number ~= d.scan then flow.scan = nil end
    flow.descriptor = d
  end,
  [ANCHOR] = function(flow, _, bytes, at, m)
    local a = {crs = number_at(bytes, at), moving = number_at(bytes, at + 12) % 2 == 1, packet = m.packet,
               until_ns = 1e6 * number_at(bytes, at + 196)}
    a.x, a.y, a.z, a.scale = unpack_bytes("<dddd", bytes, at + 17)
    a.sx, a.sy, a.sz = unpack_bytes("<ddd", bytes, at + 169)
    a.height_m = number_at(bytes, at + 192) == 1 and unpack_bytes("<d", bytes, at + 65) or a.z -- ellipsoidal
    if a.sx == 0 then a.sx = a.scale end
    if a.sy == 0 then a.sy = a.scale end
    if a.sz == 0 then a.sz = a.scale end
    flow.anchor = flow.descriptor and a
  end,
  [EMITTER] = function(flow, _, bytes, at) flow.emitter = number_at(bytes, at) ~= 0 end,
  [POINTS] = function(flow, h, bytes, at, m)
    local _, line = unpack_bytes("<I4I4", bytes, at + 1)
    local pulse0, t0_ns = number64(bytes, at + 8), signed64(bytes, at + 16)
    local n_pulses, n = unpack_bytes("<I4I4", bytes, at + 33)
    if flow.last_pulse0 and pulse0 < flow.last_pulse0 then forget(flow) end
    if flow.anchor and flow.anchor.until_ns ~= 0 and t0_ns >= flow.anchor.until_ns then flow.anchor = nil end
    local scan_t0_ns = signed64(h.raw, 15) - t0_ns
    if not (flow.scan_t0_ns and math.abs(flow.scan_t0_ns - scan_t0_ns) <= 1000) then flow.received = 0 end
    flow.received = flow.received + n_pulses -- since the first points with this start of a scan
    flow.last_pulse0, flow.scan_t0_ns, flow.points_ns = pulse0, scan_t0_ns, signed64(h.raw, 15)
    flow.points = {seq = h.seq, packet = m.packet, key = pulse0 .. "/" .. line .. "/" .. n,
                   waves = pulse0 .. "/" .. line .. "/" .. time_in(h)}
    local begun = 0
    for i = 0, n - 1 do
      if byte(bytes, at + 40 + 20 * i + 20) % 16 < 2 then begun = begun + 1 end
    end
    if begun ~= n_pulses then m.counts = string.format("%d pulses begin, and n_pulses is %d", begun, n_pulses) end
    if flow.line.number and flow.line.number ~= line then flow.line = {pulses = 0, whole = false} end
    flow.line.number, flow.line.pulses = line, flow.line.pulses + n_pulses
    if flow.scan then flow.scan.received = flow.scan.received + n_pulses end
  end,
  [LINE_END] = function(flow, _, bytes, at, m)
    local line, fired, cast = number_at(bytes, at + 4), unpack_bytes("<I4I4", bytes, at + 33)
    local sums = flow.line
    if fired < cast then m.counts = string.format("%d pulses cast of %d fired", cast, fired) end
    if sums.whole and (sums.number == nil or sums.number == line) then
      m.line_lost = cast - sums.pulses
      if m.line_lost < 0 then m.counts = string.format("%d pulses cast, and %d in points frames", cast, sums.pulses) end
    end
    flow.line = {pulses = 0, whole = true}
  end,
  [TELEMETRY] = function(flow, h, bytes, at)
    local is_final = h.length >= 96 and number_at(bytes, at) ~= 4 -- within a scan (4: scanning) counts are not final
    if not is_final then flow.final = nil return end
    flow.final = {scan = number_at(bytes, at + 4), fired = number64(bytes, at + 72), cast = number64(bytes, at + 80),
                  lost = number64(bytes, at + 88)}
  end,
  [EVENT] = function(flow, h, bytes, at, m)
    local code, a = number_at(bytes, at), number64(bytes, at + 8)
    local b, c = number64(bytes, at + 16), number64(bytes, at + 24)
    if code == 2 then
      -- A scan of the same number with another start is another scan: the head has started again. Times that a number
      -- of Lua can't hold exactly are rounded by less than 1000 ns.
      local is_other = flow.last_pulse0 and math.abs(flow.scan_t0_ns - signed64(bytes, at + 16)) > 1000
      if flow.descriptor and (flow.descriptor.scan ~= a or is_other) then forget(flow) end
      if is_other then flow.final = nil end
      -- The event of the scan at hand can come after its first points, which count. One that is not later than the
      -- last points is of another scan with the same start: two recordings may follow each other.
      if flow.last_pulse0 and not is_other and signed64(h.raw, 15) > flow.points_ns then
        flow.scan = {number = a, received = flow.received}
      else
        begin_scan(flow, a)
      end
    elseif code == 3 and flow.final and flow.final.scan == a then
      local f = flow.final
      if f.fired ~= b or f.lost ~= c or f.cast > f.fired or f.lost > f.cast then
        m.counts = string.format("telemetry: %.0f fired, %.0f cast, %.0f lost; SCAN_END: %.0f fired, %.0f lost",
                                 f.fired, f.cast, f.lost, b, c)
      end
      if flow.scan and flow.scan.number == a then m.missing = f.cast - f.lost - flow.scan.received end
      flow.scan = nil
    end
  end,
}

local function is_of_points(flow, h, bytes, at)
  local points = flow.points
  local after = h.type == COLOURS and flow.descriptor and flow.descriptor.content % 2 == 1 and 2 or 1
  local pulse0, line, n = number64(bytes, at), unpack_bytes("<I4I4", bytes, at + 9)
  return points and (points.seq + after) % MODULUS == h.seq and points.key == pulse0 .. "/" .. line .. "/" .. n
end

-- Frames of waveforms may be lost one by one, so their numbers say nothing.
local function is_wave_of_points(flow, h, bytes, at)
  local points = flow.points
  return points and points.waves == number64(bytes, at) .. "/" .. number_at(bytes, at + 8) .. "/" .. time_in(h)
end

-- A whole frame seen for the first time: all that a later look at it needs goes to m.
local function absorb(flow, h, bytes, at, m)
  m.notice, m.first_lost, m.lost = take_sequence(flow.sequence, h)
  if m.notice == GAP then
    flow.lost = flow.lost + m.lost
    flow.line.whole = false
  end
  if m.notice == RESTARTED then
    -- A descriptor for this reader alone that came just before belongs to the new sequence already.
    if not flow.told_alone then forget(flow) end
    flow.scan, flow.final, flow.last_pulse0, flow.scan_t0_ns = nil, nil, nil, nil
    flow.line = {pulses = 0, whole = false}
  end
  flow.told_alone = h.is_local and (flow.told_alone or h.type == DESCRIPTOR)
  if m.notice then m.lost_so_far = flow.lost end
  if h.version ~= 1 then return end
  m.has_deviations = flow.descriptor and floor(flow.descriptor.content / 8) % 2 == 1
  m.wrong = wrong_payload(h, bytes, at, m) or false
  if m.wrong or m.notice == REPEATED or m.notice == LATE then return end
  if ABSORB[h.type] then ABSORB[h.type](flow, h, bytes, at, m) end
  m.descriptor, m.anchor, m.emitter = flow.descriptor, flow.anchor, flow.emitter
  if h.type == ATTRIBUTES or h.type == COLOURS then
    m.points_in = is_of_points(flow, h, bytes, at) and flow.points.packet
  elseif h.type == WAVES then
    m.points_in = is_wave_of_points(flow, h, bytes, at) and flow.points.packet
  end
end

-- ---- items of the tree

-- Says whether these fields are needed: the tree is shown, or a filter or a column uses one of them.
local function is_wanted(tree, fields)
  if tree.visible then return true end
  for _, field in ipairs(fields) do
    if tree:referenced(field) then return true end
  end
  return false
end

-- The text up to its NUL. A text without NUL is taken whole; wrong_row reports it.
local function text_of(range)
  local n = range:bytes():raw():find("\0", 1, true)
  n = n and n - 1 or range:len()
  return n > 0 and range(0, n):string(ENC_UTF_8) or ""
end

local function put_row(tree, row, tvb, at)
  local parent = tree
  if row.count > 1 then
    local words = {}
    for i = 0, row.count - 1 do words[i + 1] = string.format("%.9g", tvb(at + 8 * i, 8):le_float()) end
    parent = tree:add(tvb(at, row.size * row.count), row[3] .. ": " .. table.concat(words, " "))
  end
  for i = 0, row.count - 1 do
    local range, item = tvb(at + i * row.size, row.size), nil
    if row.kind == "text" then
      local words = text_of(range)
      if words == "" then return end
      item = parent:add(row.field, range, words)
    elseif row.is_real then
      item = put_real(parent, row.field, range, row.value and row.value(range) or range:le_float())
    elseif row.value then
      item = parent:add(row.field, range, row.value(range))
    else
      item = parent:add_le(row.field, range)
    end
    if row.known and range:le_uint() >= row.known then item:add_proto_expert_info(E.reserved) end
    for _, field in ipairs(row.bits or {}) do item:add_le(field, range) end
    row.item = item
  end
end

local function put_rows(tree, rows, tvb, at, len)
  for _, row in ipairs(rows) do
    if row.at + row.size * row.count <= len then put_row(tree, row, tvb, at + row.at) end
  end
end

local function fields_of(rows)
  if not rows.fields then
    rows.fields = {}
    for _, row in ipairs(rows) do
      rows.fields[#rows.fields + 1] = row.field
      for _, field in ipairs(row.bits or {}) do rows.fields[#rows.fields + 1] = field end
    end
  end
  return rows.fields
end

-- Adds n records of len bytes from `at` on, a hundred in a group; put(group, position, i) adds one. Records beyond the
-- preference are only counted.
local GROUP = 100
local function put_records(tree, tvb, at, len, n, what, put)
  local shown = math.min(n, scanhead.prefs.most)
  local group = tree
  for i = 0, shown - 1 do
    if shown > GROUP and i % GROUP == 0 then
      local last = math.min(i + GROUP, shown) - 1
      group = tree:add(tvb(at + i * len, (last - i + 1) * len), string.format("%s %d to %d", what, i, last))
    end
    put(group, at + i * len, i)
  end
  if shown == n then return end
  tree:add(tvb(at + shown * len, (n - shown) * len),
           string.format("%d more (preference: most points shown)", n - shown))
end

-- WGS 84, NIMA TR8350.2: geodetic to geocentric.
local function geocentric(lat_deg, lon_deg, height)
  local f = 1 / 298.257223563
  local e2, s, c = f * (2 - f), math.sin(math.rad(lat_deg)), math.cos(math.rad(lat_deg))
  local n = 6378137.0 / math.sqrt(1 - e2 * s * s)
  return (n + height) * c * math.cos(math.rad(lon_deg)), (n + height) * c * math.sin(math.rad(lon_deg)),
    (n * (1 - e2) + height) * s
end

-- The fields of points that are needed, by the name after their dot. Others are not worked out, since a frame has
-- thousands of points.
local function fields_needed(tree)
  local wanted, any = {}, false
  for _, name in ipairs({"pulse", "t_s", "echo", "echo_count", "label", "reflectance_db", "range_m", "line_deg",
                         "pan_deg", "x", "y", "z"}) do
    wanted[name] = (tree.visible or tree:referenced(F["point." .. name])) and F["point." .. name]
    any = any or wanted[name]
  end
  return (any or tree:referenced(F["point"])) and wanted
end

local function put_geo(item, wanted, m, tvb, at, a, b, c)
  local anchor = m.anchor
  local dx, dy, dz = anchor.sx * a, anchor.sy * b, anchor.sz * c
  local x, y, z, range = anchor.x + dx, anchor.y + dy, anchor.z + dz, nil
  local unit = anchor.crs == 3 and "°" or "m"
  if anchor.crs == 3 and y > 180 then y = y - 360 elseif anchor.crs == 3 and y < -180 then y = y + 360 end
  if wanted.range_m and anchor.crs == 3 and not anchor.moving then
    local x0, y0, z0 = geocentric(anchor.x, anchor.y, anchor.height_m)
    local x1, y1, z1 = geocentric(x, y, anchor.height_m + dz)
    range = math.sqrt((x1 - x0) ^ 2 + (y1 - y0) ^ 2 + (z1 - z0) ^ 2)
  elseif wanted.range_m and not anchor.moving then
    range = math.sqrt(dx * dx + dy * dy + dz * dz)
  end
  if wanted.x then put_real(item, wanted.x, tvb(at, 4), x, unit) end
  if wanted.y then put_real(item, wanted.y, tvb(at + 4, 4), y, unit) end
  if wanted.z then put_real(item, wanted.z, tvb(at + 8, 4), z) end
  if range then put_real(item, wanted.range_m, tvb(at, 12), range):set_generated() end
  return string.format(anchor.crs == 3 and "%.8f° %.8f° %.4f m" or "%.4f %.4f %.4f m", x, y, z)
end

-- The line angle lies within half a turn of the middle of the line. If the emitter is of another kind than `line`
-- (m.emitter), the angle is an elevation, within half a turn of zero.
local function angles_of(m, b, c)
  local d = m.descriptor
  local mirror, pan = b / d.mirror_counts, c / d.pan_counts
  return 360 * (mirror - floor(mirror - (m.emitter and 0 or d.middle) + 0.5)), 360 * (pan - floor(pan))
end

local function put_polar(item, wanted, m, tvb, at, a, b, c, has_echo)
  local d, words = m.descriptor, "no echo"
  local line_deg, pan_deg = angles_of(m, b, c)
  if has_echo then
    local range, pan_rad, line_rad = d.range_scale * a, math.rad(pan_deg), math.rad(line_deg)
    local flat = range * math.cos(line_rad)
    if wanted.range_m then put_real(item, wanted.range_m, tvb(at, 4), range) end
    if wanted.x then put_real(item, wanted.x, tvb(at, 12), flat * math.sin(pan_rad), "m"):set_generated() end
    if wanted.y then put_real(item, wanted.y, tvb(at, 12), flat * math.cos(pan_rad), "m"):set_generated() end
    if wanted.z then put_real(item, wanted.z, tvb(at, 12), range * math.sin(line_rad)):set_generated() end
    words = string.format("%.4f m", range)
  end
  if wanted.line_deg then put_real(item, wanted.line_deg, tvb(at + 4, 4), line_deg) end
  if wanted.pan_deg then put_real(item, wanted.pan_deg, tvb(at + 8, 4), pan_deg) end
  return string.format("%s, line %.4f°, pan %.4f°", words, line_deg, pan_deg)
end

-- Points show range and place once descriptor and anchor have come. Before that they show what needs neither.
local function put_points(tree, tvb, bytes, at, _, m)
  local pulse, n = number64(bytes, at + 8) - 1, number_at(bytes, at + 36)
  local can_place = m.descriptor and m.anchor
  local is_geo = can_place and m.descriptor.layout == 1
  if can_place then
    tree:add(F["descriptor_in"], m.descriptor.packet):set_generated()
    tree:add(F["anchor_in"], m.anchor.packet):set_generated()
  elseif m.notice ~= REPEATED and m.notice ~= LATE then
    tree:add_proto_expert_info(E.no_anchor)
  end
  local wanted, is_shown = fields_needed(tree), tree.visible
  if not wanted then return end
  local t0 = tvb(at + 16, 8):le_int64()
  local t0_s, t0_ns = (t0 / 1000000000):tonumber(), (t0 % 1000000000):tonumber()
  put_records(tree, tvb, at + 40, 20, n, "Points", function(group, from, i)
    local a, b, c, refl, label, tail = unpack_bytes(is_geo and "<i4i4i4i2I2I4" or "<I4I4I4i2I2I4", bytes, from + 1)
    local dt, echoes = tail % 16777216, floor(tail / 16777216)
    local echo, count = echoes % 16, floor(echoes / 16)
    if echo < 2 then pulse = pulse + 1 end
    local item, words = group:add(F["point"], tvb(from, 20)), count == 0 and "no echo" or ""
    if is_geo and count > 0 then words = put_geo(item, wanted, m, tvb, from, a, b, c)
    elseif can_place and not is_geo then words = put_polar(item, wanted, m, tvb, from, a, b, c, count > 0) end
    local has_reflectance = refl ~= -32768
    if has_reflectance and wanted.reflectance_db then
      put_real(item, wanted.reflectance_db, tvb(from + 12, 2), refl / 100)
    end
    if wanted.label then item:add(wanted.label, tvb(from + 14, 2), label) end
    if wanted.t_s then
      local carry = floor((t0_ns + dt) / 1000000000)
      item:add(wanted.t_s, tvb(from + 16, 3), NSTime.new(t0_s + carry, t0_ns + dt - carry * 1000000000))
    end
    if wanted.echo then item:add(wanted.echo, tvb(from + 19, 1), echo) end
    if wanted.echo_count then item:add(wanted.echo_count, tvb(from + 19, 1), count) end
    if wanted.pulse then item:add(wanted.pulse, tvb(from, 20), UInt64.new(pulse)):set_generated() end
    if not is_shown then return end
    item:set_text(string.format("Point %d: pulse %.0f, echo %d of %d: %s%s%s", i, pulse, echo, count, words,
                                has_reflectance and string.format(", %.2f dB", refl / 100) or "",
                                label ~= 0xffff and string.format(", label %d", label) or ""))
  end)
end

local function put_attributes(tree, tvb, bytes, at, _, m)
  if not is_wanted(tree, ATTRIBUTE_FIELDS) then return end
  local n = number_at(bytes, at + 12)
  put_records(tree, tvb, at + 16, 4, n, "Attributes", function(group, from, i)
    local amplitude, width = unpack_bytes("<i2I2", bytes, from + 1)
    local item = group:add(tvb(from, 4), string.format("Point %d:%s%s", i,
      amplitude ~= -32768 and string.format(" %.2f dB", amplitude / 100) or " not modelled",
      width ~= 0 and string.format(", %.2f ns%s", width / 100, width == 65535 and " or more" or "") or ", no width"))
    if amplitude ~= -32768 then put_real(item, F["attribute.amplitude_db"], tvb(from, 2), amplitude / 100) end
    if width ~= 0 then put_real(item, F["attribute.width_ns"], tvb(from + 2, 2), width / 100) end
    if m.has_deviations then
      local range = tvb(at + 16 + 4 * n + 2 * i, 2)
      put_real(item, F["attribute.deviation"], range, range:le_uint() / 1000)
    end
  end)
end

local function put_colours(tree, tvb, bytes, at)
  if not is_wanted(tree, COLOUR_FIELDS) then return end
  put_records(tree, tvb, at + 16, 3, number_at(bytes, at + 12), "Colours", function(group, from, i)
    local red, green, blue = byte(bytes, from + 1, from + 3)
    local item = group:add(tvb(from, 3), string.format("Point %d: #%02x%02x%02x", i, red, green, blue))
    for k = 1, 3 do item:add(COLOUR_FIELDS[k], tvb(from + k - 1, 1)) end
  end)
end

local function put_beam(item, m, tvb, from)
  local d = m.descriptor
  if d and d.layout == 1 then
    for k, name in ipairs({"dx", "dy", "dz"}) do
      local range = tvb(from + 12 + 4 * k, 4)
      put_real(item, F["wave." .. name], range, range:le_float())
    end
  elseif d then
    local line, pan = tvb(from + 20, 4), tvb(from + 24, 4)
    local line_deg, pan_deg = angles_of(m, line:le_uint(), pan:le_uint())
    put_real(item, F["wave.line_deg"], line, line_deg)
    put_real(item, F["wave.pan_deg"], pan, pan_deg)
  end
end

local function put_waves(tree, tvb, bytes, at, _, m)
  if not is_wanted(tree, WAVE_FIELDS) then return end
  local pulse0, n_windows, step_ps = number64(bytes, at), number_at(bytes, at + 12), number_at(bytes, at + 16)
  local from = at + 32
  for i = 1, math.min(n_windows, scanhead.prefs.most) do
    local offset, dt_ns, first, n = unpack_bytes("<I4I4I4I2", bytes, from + 1)
    local len, counts = 28 + 2 * (n + n % 2), {}
    for k = 0, n - 1 do counts[k + 1] = number_at(bytes, from + 28 + 2 * k, "<I2") end
    local range_m = 1e-3 * step_ps * (0.5 * 0.299792458) * first
    local item = tree:add(tvb(from, len), string.format("Window %d: pulse %.0f, %d samples from %.3f m on", i - 1,
                                                        pulse0 + offset, n, range_m))
    item:add(F["wave.pulse"], tvb(from, 4), UInt64.new(pulse0 + offset)):set_generated()
    item:add(F["wave.dt_ns"], tvb(from + 4, 4), dt_ns)
    item:add(F["wave.first"], tvb(from + 8, 4), first)
    item:add(F["wave.n"], tvb(from + 12, 2), n)
    put_real(item, F["wave.range_m"], tvb(from + 8, 4), range_m):set_generated()
    put_beam(item, m, tvb, from)
    item:add(F["wave.counts"], tvb(from + 28, 2 * n), table.concat(counts, " "))
    from = from + len
  end
  if n_windows > scanhead.prefs.most then
    tree:add(tvb(from), string.format("%d more (preference: most points shown)", n_windows - scanhead.prefs.most))
  end
end

local function put_surfaces(tree, tvb, bytes, at)
  if not is_wanted(tree, SURFACE_FIELDS) then return end
  local first, count = unpack_bytes("<I4I4", bytes, at + 1)
  local from = at + 8
  for i = 0, count - 1 do
    local n = byte(bytes, from + 1)
    local m = byte(bytes, from + 2 + n)
    local object, material = bytes:sub(from + 2, from + 1 + n), bytes:sub(from + 3 + n, from + 2 + n + m)
    local item = tree:add(tvb(from, n + m + 2), string.format("Label %d: %s of %s", first + i, object, material))
    item:add(F["surface.label"], tvb(from, n + m + 2), first + i):set_generated()
    item:add(F["surface.object"], tvb(from, n + 1), object)
    item:add(F["surface.material"], tvb(from + n + 1, m + 1), material)
    from = from + n + m + 2
  end
end

local function put_table(tree, tvb, at, n, rows, what, words)
  if not is_wanted(tree, fields_of(rows)) then return end
  put_records(tree, tvb, at, rows.len, n, what, function(group, from, i)
    put_rows(group:add(tvb(from, rows.len), words(from, i)), rows, tvb, from, rows.len)
  end)
end

local function put_poses(tree, tvb, bytes, at)
  put_table(tree, tvb, at + 8, number_at(bytes, at), ROWS.pose, "Poses", function(from, i)
    local x, y, z = unpack_bytes("<ddd", bytes, from + 9)
    return string.format("Pose %d: %.6f s, %.4f %.4f %.4f m", i, signed64(bytes, from) / 1e9, x, y, z)
  end)
end

local function put_beams(tree, tvb, bytes, at)
  put_table(tree, tvb, at + 64, number_at(bytes, at + 4), ROWS.beam, "Beams", function(from, i)
    local elevation, azimuth, ns = unpack_bytes("<i4i4I4", bytes, from + 1)
    return string.format("Beam %d: elevation %.6f°, azimuth %.6f°, %d ns", i, elevation / 1e6, azimuth / 1e6, ns)
  end)
end

local RECORDS = {[POINTS] = put_points, [ATTRIBUTES] = put_attributes, [COLOURS] = put_colours,
                 [SURFACES] = put_surfaces, [POSES] = put_poses, [EMITTER] = put_beams, [WAVES] = put_waves}

-- Where the windows of waveforms end.
local function waves_len(bytes, at)
  local len = 32
  for _ = 1, number_at(bytes, at + 12) do
    local n = number_at(bytes, at + len + 12, "<I2")
    len = len + 28 + 2 * (n + n % 2)
  end
  return len
end

-- Length of a payload with its records; bytes after that may belong to a later version.
local function known_len(h, bytes, at, m)
  local list = list_of(h, m)
  if list then return list[3] + list[4] * number_at(bytes, at + list[2]) end
  if h.type == WAVES then return waves_len(bytes, at) end
  if h.type == SURFACES then return h.length end
  if h.type == DESCRIPTOR and h.length >= 280 then return 280 end
  if h.type == TELEMETRY and h.length >= 104 then return h.length >= 152 and 152 or 104 end
  return math.min(ROWS[h.type].len, h.length)
end

-- Names of an event's a, b and c.
local EVENTS = {
  {"new state", "state before"}, {"scan", "device time of pulse 0", "its GPS time"},
  {"scan", "pulses fired", "pulses lost by the head"},
  {"first lost pulse", "pulses lost", "ticks lost"}, {"frames lost now", "pulses in them", "frames lost in all"},
  {"session with control"}, {"SCPI number", "session", "errors held back"}, {"first pulse with the new settings"},
  {"poses made up so far", nil, "since the last one"}, {"UTC, s since 1970", "device time of the edge", "GPS time, s"},
  {nil, "device time", "its GPS time"}, {"station", "warnings of its place"},
  {"port + 256 * servo", "device time", "grandmaster"},
}
-- Which of a, b and c are in nanoseconds; they are shown in seconds.
local IN_SECONDS = {[2] = {false, true, true}, [9] = {false, false, true}, [10] = {false, true, false},
                    [11] = {false, true, true}, [13] = {false, true, false}}
local TROUBLE = {[4] = "event_warning", [5] = "event_warning", [9] = "event_warning", [7] = "event_note",
                 [2] = "event_chat", [3] = "event_chat"}

local function event_words(code, i, value, range)
  local meaning = EVENTS[code] and EVENTS[code][i]
  if not meaning then return "" end
  if code == 1 then return string.format(" (%s: %s)", meaning, STATES[value] or "?") end
  if code == 7 and i == 1 then return string.format(" (%s: %s)", meaning, tostring(range:le_int64())) end
  if IN_SECONDS[code] and IN_SECONDS[code][i] then
    return string.format(" (%s: %s s)", meaning, tostring(time_of(range:le_int64())))
  end
  return " (" .. meaning .. ")"
end

local function put_event(tree, tvb, bytes, at)
  local code = number_at(bytes, at)
  local values = {number64(bytes, at + 8), number64(bytes, at + 16), number64(bytes, at + 24)}
  for i = 1, 3 do ROWS[EVENT][i + 2].item:append_text(event_words(code, i, values[i], tvb(at + 8 * i, 8))) end
  local name = ROWS[EVENT][1][4][code]
  local text = text_of(tvb(at + 32, 96))
  local which = code == 1 and values[1] == 6 and "event_warning" or TROUBLE[code]
  if which then tree:add_proto_expert_info(E[which], name .. (text ~= "" and ": " .. text or "")) end
  if not name then tree:add_proto_expert_info(E.type_unknown, "An event that version 1 does not have yet") end
end

local function put_payload(tree, tvb, bytes, at, h, m)
  local rows = ROWS[h.type]
  if not rows then
    if h.length > 0 then tree:add(F["payload"], tvb(at, h.length)) end
    tree:add_proto_expert_info(E.type_unknown)
    return
  end
  -- The packet's first look found no such frame, so that absorb has not checked it.
  if m.wrong == nil then m.wrong = wrong_payload(h, bytes, at, m) end
  put_rows(tree, rows, tvb, at, h.length)
  if h.type == DESCRIPTOR and h.length >= 280 then put_rows(tree, ROWS.content, tvb, at + 272, 8) end
  if h.type == TELEMETRY and h.length >= 104 then put_rows(tree, ROWS.lost_lines, tvb, at + 96, 8) end
  if h.type == TELEMETRY and h.length >= 152 then put_rows(tree, ROWS.ptp, tvb, at + 104, 48) end
  if m.wrong then
    tree:add_proto_expert_info(E.wrong, m.wrong)
    return
  end
  if RECORDS[h.type] then RECORDS[h.type](tree, tvb, bytes, at, h, m) end
  if h.type == EVENT then put_event(tree, tvb, bytes, at) end
  local known = known_len(h, bytes, at, m)
  if h.length > known then
    tree:add(F["unknown"], tvb(at + known, h.length - known)):add_proto_expert_info(E.longer)
  end
end

-- Adds findings that concern a frame's neighbours: its sequence number, its points, its counts.
local function put_findings(tree, h, m)
  if m.notice then
    tree:add(F["seq.notice"], m.notice):set_generated()
    if m.notice == GAP then
      tree:add(F["seq.first_lost"], m.first_lost):set_generated()
      tree:add(F["seq.lost"], m.lost):set_generated()
      tree:add_proto_expert_info(E.gap, string.format("%.0f frames are missing before this one, from %.0f on", m.lost,
                                                      m.first_lost))
    else
      tree:add_proto_expert_info(E[NOTICES[m.notice]])
    end
    tree:add(F["seq.lost_so_far"], UInt64.new(m.lost_so_far)):set_generated()
  end
  if m.points_in then tree:add(F["points_in"], m.points_in):set_generated() end
  if m.points_in == false then tree:add_proto_expert_info(E.no_points) end
  if m.counts then tree:add_proto_expert_info(E.counts, m.counts) end
  if m.line_lost then tree:add(F["line_end.lost_pulses"], Int64.new(m.line_lost)):set_generated() end
  if m.missing then
    tree:add(F["missing_pulses"], Int64.new(m.missing)):set_generated()
    if m.missing > 0 then
      tree:add_proto_expert_info(E.missing, string.format("%.0f pulses of the scan are not in this capture", m.missing))
    elseif m.missing < 0 then
      tree:add_proto_expert_info(E.counts, string.format("%.0f pulses more than the head has delivered", -m.missing))
    end
  end
end

local function put_header(tree, tvb, at, header_ok, payload_ok)
  local function put(name, from, n) return tree:add_le(F[name], tvb(at + from, n)) end
  put("type", 1, 1)
  put("version", 2, 1)
  local flags = put("flags", 3, 1)
  flags:add(F["flags.repeat"], tvb(at + 3, 1))
  flags:add(F["flags.local"], tvb(at + 3, 1))
  if header_ok and tvb(at + 3, 1):uint() > 3 then flags:add_proto_expert_info(E.reserved) end
  put("length", 4, 4)
  put("seq", 8, 4)
  local crc = put("payload_crc", 12, 4)
  if payload_ok ~= nil then
    tree:add(F["payload_crc.status"], tvb(at + 12, 4), payload_ok and 1 or 0):set_generated()
  end
  if payload_ok == false then crc:add_proto_expert_info(E.bad_payload) end
  tree:add(F["t_s"], tvb(at + 16, 8), time_of(tvb(at + 16, 8):le_int64()))
  crc = put("header_crc", 24, 4)
  tree:add(F["header_crc.status"], tvb(at + 24, 4), header_ok and 1 or 0):set_generated()
  if not header_ok then crc:add_proto_expert_info(E.bad_header) end
end

-- The text of a frame in the packet list.
local function summary(h, bytes, at, m)
  local name = TYPES[h.type] or string.format("Type %d", h.type)
  if m.wrong or h.version ~= 1 then return name .. " [wrong]" end
  if h.type == POINTS then
    local line, n = number_at(bytes, at + 4), number_at(bytes, at + 36)
    return string.format("%s of line %d: %d", name, line, n)
  elseif h.type == LINE_END then
    return string.format("%s %d", name, number_at(bytes, at + 4))
  elseif h.type == EVENT then
    local code = number_at(bytes, at)
    local state = code == 1 and STATES[number64(bytes, at + 8)]
    return string.format("%s %s%s", name, ROWS[EVENT][1][4][code] or code, state and " to " .. state or "")
  elseif h.type == TELEMETRY then
    return string.format("%s, %s", name, STATES[number_at(bytes, at)] or "?")
  elseif h.type == DESCRIPTOR then
    return string.format("%s of scan %d%s", name, number_at(bytes, at + 260), h.is_repeat and ", REPEAT" or "")
  elseif h.type == ANCHOR then
    return string.format("%s of station %d%s", name, number_at(bytes, at + 8), h.is_repeat and ", REPEAT" or "")
  end
  return name
end

-- ---- the search for frames, as native_parser.c does it

-- The fields of a header, or nil if it is not correct. 28 bytes have to be there.
local function header_at(bytes, at)
  if byte(bytes, at + 1) ~= SYNC then return nil end
  local _, kind, version, flags, length, seq, payload_crc = unpack_bytes("<BBBBI4I4I4", bytes, at + 1)
  if length > MOST_PAYLOAD or crc32c(bytes, at, 24) ~= number_at(bytes, at + 24) then return nil end
  return {type = kind, version = version, flags = flags, length = length, seq = seq, payload_crc = payload_crc,
          is_repeat = flags % 2 == 1, is_local = floor(flags / 2) % 2 == 1, raw = bytes:sub(at + 2, at + 24)}
end

-- Where the next correct header begins, from `at` on and before `last`. A sync byte counts, too, if the bytes
-- after it are too few for a header.
local function next_header(bytes, at, last)
  while true do
    local found = bytes:find("\xd5", at + 1, true)
    if not found or found > last then return nil end
    at = found - 1
    if at + HEADER_LEN > #bytes or header_at(bytes, at) then return at end
    at = at + 1
  end
end

local function new_flow()
  return {sequence = new_sequence(), in_step = true, started = false, lost = 0, waiting = 0,
          line = {pulses = 0, whole = false}}
end

-- Results of the first look at each packet, by packet number and content. Positions can't be the key, since at
-- the next look Wireshark may cut the same bytes at other places. Equal contents in a packet get their results in turn.
local memo

local function memo_of(pinfo)
  local packet = memo[pinfo.number]
  if not packet then
    packet = {}
    memo[pinfo.number] = packet
  end
  return packet
end

-- The entry of `what`; a new one is given to make(entry) once.
local function find(pinfo, what, make)
  local packet = memo_of(pinfo)
  local entry = packet[what]
  if pinfo.visited then
    if entry and entry.turns then
      entry.turn = (entry.turn or 0) % #entry.turns + 1
      return entry.turns[entry.turn]
    end
    return entry or {packet = pinfo.number}
  end
  local m = {packet = pinfo.number}
  if not entry then
    packet[what] = m
  elseif entry.turns then
    entry.turns[#entry.turns + 1] = m
  else
    packet[what] = {turns = {entry, m}}
  end
  make(m)
  return m
end

local function note_info(pinfo, words)
  pinfo.cols.info:append((tostring(pinfo.cols.info) == "" and "" or "; ") .. words)
end

-- Searches one piece of the stream: first it finds items (`items`), then it shows them, or waits. can_wait: more bytes
-- may come.
local Search = {}
Search.__index = Search

local function new_search(tvb, pinfo, tree, conn, can_wait)
  local flow = conn.down
  local self = setmetatable({tvb = tvb, pinfo = pinfo, tree = tree, conn = conn, flow = flow, can_wait = can_wait,
                             at = 0, len = tvb:len(), bytes = tvb:raw(0, tvb:len()), items = {}, said = 0, reach = 0},
                            Search)
  if conn.is_stream then
    local packet, key = memo_of(pinfo), "starts with " .. self.bytes:sub(1, 28)
    if not packet[key] and not pinfo.visited then packet[key] = {in_step = flow.in_step, started = flow.started} end
    local start = packet[key] or {in_step = true, started = true}
    self.in_step, self.started = start.in_step, start.started
  else
    self.in_step, self.started = true, true
  end
  return self
end

function Search:add(show, from, ...) self.items[#self.items + 1] = {show, from, ...} end

function Search:say(words)
  self.said = self.said + 1
  if self.said <= 6 then note_info(self.pinfo, words) elseif self.said == 7 then note_info(self.pinfo, "...") end
end

-- Shows bytes up to `to` that belong to nothing. Where they look like a frame, its header is shown.
function Search:show_garbage(from, to, is_join)
  local tvb, n = self.tvb, to - from
  local item = self.tree:add(scanhead, tvb(from, n),
                             string.format("Scan head, %d bytes that belong to no frame and no line", n))
  if is_join then
    item:add(F["bad_bytes"], tvb(from, n)):add_proto_expert_info(E.joined)
  else
    if byte(self.bytes, from + 1) == SYNC and n >= HEADER_LEN then put_header(item, tvb, from, false, nil) end
    item:add(F["bad_bytes"], tvb(from, n)):add_proto_expert_info(E.garbage)
    self:say("[bad bytes]")
  end
end

function Search:end_garbage()
  local from = self.garbage
  self.garbage = nil
  if not from or from == self.at then return end
  self:add(self.show_garbage, from, self.at, self.conn.is_stream and not self.started)
end

-- Skips bytes up to `to`. reach: the end of the bytes that were needed to decide this.
function Search:skip(to, reach)
  if not self.garbage then self.garbage = self.at end
  self.reach = math.max(self.reach, reach or to)
  self.at, self.in_step = to, false
end

function Search:take(n, show, ...)
  self:end_garbage()
  self:add(show, self.at, ...)
  self.at, self.in_step, self.started = self.at + n, true, true
end

function Search:show_frame(at, h)
  local tvb, payload = self.tvb, at + HEADER_LEN
  local m = find(self.pinfo, h.raw, function(m) absorb(self.flow, h, self.bytes, payload, m) end)
  local words = summary(h, self.bytes, payload, m)
  local item = self.tree:add(scanhead, tvb(at, HEADER_LEN + h.length), "Scan head, " .. words)
  put_header(item, tvb, at, true, true)
  put_findings(item, h, m)
  if h.version == 1 then
    put_payload(item, tvb, self.bytes, payload, h, m)
  else
    item:add_proto_expert_info(E.version_unknown)
  end
  self:say(words .. (m.notice and " [" .. NOTICES[m.notice] .. "]" or ""))
end

function Search:show_broken(at, h, to, is_cut)
  local tvb = self.tvb
  local name = TYPES[h.type] or string.format("Type %d", h.type)
  local item = self.tree:add(scanhead, tvb(at, to - at), "Scan head, broken frame: " .. name)
  if is_cut then
    put_header(item, tvb, at, true, nil)
    item:add_proto_expert_info(E.cut)
  else
    put_header(item, tvb, at, true, false)
  end
  if to > at + HEADER_LEN then item:add(F["payload"], tvb(at + HEADER_LEN, to - at - HEADER_LEN)) end
  self:say(name .. (is_cut and " [cut]" or " [bad CRC]"))
  if not self.pinfo.visited then self.flow.line.whole = false end
end

-- Takes a frame whose header is correct, but whose payload is wrong or not complete. Other frames may stand within its
-- length, so it ends at the next header.
function Search:take_broken(h, is_cut)
  local last = math.min(self.at + HEADER_LEN + h.length, self.len)
  local to = next_header(self.bytes, self.at + 1, last) or last
  self.reach = math.max(self.reach, last)
  self:take(to - self.at, self.show_broken, h, to, is_cut)
  self.in_step = false
end

-- Returns true and a number when it waits for that many bytes (nil: not known); else it went on.
function Search:look_frame()
  local have = self.len - self.at
  if have < HEADER_LEN then
    if self.can_wait then return true end
    return self:skip(next_header(self.bytes, self.at + 1, self.len) or self.len)
  end
  local h = header_at(self.bytes, self.at)
  if not h then return self:skip(self.at + 1, self.at + HEADER_LEN) end
  if have < HEADER_LEN + h.length then
    if self.can_wait then return true, HEADER_LEN + h.length - have end
    return self:take_broken(h, true)
  end
  if crc32c(self.bytes, self.at + HEADER_LEN, h.length) ~= h.payload_crc then return self:take_broken(h, false) end
  self:take(HEADER_LEN + h.length, self.show_frame, h)
end

function Search:show_reply(at, n)
  local tvb, conn = self.tvb, self.conn
  local words = self.bytes:sub(at + 1, at + n)
  local m = find(self.pinfo, "reply " .. words, function(m)
    m.command = conn.first <= conn.last and conn.commands[conn.first] or nil
    m.unasked, m.time = conn.last > 0 and not m.command, self.pinfo.rel_ts
    if m.command then conn.first, m.command.reply_in = conn.first + 1, self.pinfo.number end
  end)
  local item = self.tree:add(scanhead, tvb(at, n + 2), "Scan head, reply: " .. words)
  item:add(F["reply"], tvb(at, n))
  local number = words:match("^ERR (%-?%d+)")
  if number then item:add(F["reply.error"], tvb(at, n), tonumber(number)):add_proto_expert_info(E.refused, words) end
  if m.command then
    item:add(F["command_in"], m.command.packet):set_generated()
    local ns = floor((m.time - m.command.time) * 1e9 + 0.5)
    item:add(F["reply_time"], NSTime.new(floor(ns / 1e9), ns % 1000000000)):set_generated()
  elseif m.unasked then
    item:add_proto_expert_info(E.unasked)
  end
  self:say("Reply " .. words)
end

function Search:look_text()
  local n = #self.bytes:match("^[ -~]*", self.at + 1)
  local ending = self.bytes:sub(self.at + n + 1, self.at + n + 2)
  local may_end = ending == "\r\n" or ending == "\r" or ending == ""
  if n > MOST_REPLY - 2 or not may_end then return self:skip(self.at + n, self.at + n + 2) end
  if ending == "\r\n" then return self:take(n + 2, self.show_reply, n) end
  if self.can_wait then return true end
  self:skip(self.len)
end

-- Returns nothing if all bytes are used. Else it returns the place where it waits, the number of bytes that it needs
-- (nil: not known), and true if TCP must not join these bytes. That is so in two cases: items before the place were
-- found with bytes from beyond it, or the place lies within bytes that the last search has kept.
function Search:run()
  local waits, more
  while self.at < self.len and not waits do
    local first = byte(self.bytes, self.at + 1)
    if first == SYNC then
      waits, more = self:look_frame()
    elseif self.in_step and first >= 0x20 and first <= 0x7e then
      waits, more = self:look_text()
    else
      self:skip((self.bytes:find("\xd5", self.at + 2, true) or self.len + 1) - 1)
    end
  end
  self:end_garbage()
  for _, item in ipairs(self.items) do item[1](self, item[2], item[3], item[4], item[5]) end
  local flow, is_old = self.flow, self.at > 0 and (self.at <= self.flow.waiting or self.at < self.reach)
  if not self.pinfo.visited then
    flow.in_step, flow.started, flow.waiting = self.in_step, self.started, waits and self.len - self.at or 0
  end
  if waits then return self.at, more, is_old end
end

local function run_search(...) return new_search(...):run() end

-- Commands of the host: lines, ended by LF, CR or CR LF. Returns the place where it waits for more, if it does.
local function run_commands(tvb, pinfo, tree, conn, can_wait)
  local bytes, at = tvb:raw(0, tvb:len()), 0
  while at < #bytes do
    local words, ending = bytes:match("^([^\r\n]*)(\r?\n?)", at + 1)
    if ending == "" and can_wait and #words <= MOST_COMMAND then return at end
    local n = #words + #ending
    if words ~= "" then
      local m = find(pinfo, "command " .. words, function(m)
        conn.last, m.time = conn.last + 1, pinfo.rel_ts
        conn.commands[conn.last] = m
      end)
      local is_text = #words <= MOST_COMMAND and not words:find("[^ -~]")
      local item = tree:add(scanhead, tvb(at, n), "Scan head, command: " .. (is_text and words or #words .. " bytes"))
      if is_text then
        item:add(F["command"], tvb(at, #words))
      else
        item:add(F["bad_bytes"], tvb(at, #words)):add_proto_expert_info(E.bad_command)
      end
      if m.reply_in then item:add(F["reply_in"], m.reply_in):set_generated() end
      note_info(pinfo, "Command " .. (is_text and words or "[bad bytes]"))
    end
    at = at + n
  end
end

-- ---- carriers

local conns

local function conn_of(key, is_stream)
  if not conns[key] then
    conns[key] = {down = new_flow(), commands = {}, first = 1, last = 0, is_stream = is_stream, pending = {}}
  end
  return conns[key]
end

-- Connections are identified by pinfo, since fields of other dissectors are not there when Wireshark reads a
-- capture for the first time and shows nothing yet.
local PORT_TYPE_TCP = 2
local function tcp_key(pinfo)
  local one, other = tostring(pinfo.src) .. " " .. pinfo.src_port, tostring(pinfo.dst) .. " " .. pinfo.dst_port
  return one < other and one .. " " .. other or other .. " " .. one
end
-- On USB one end is `host`, the other one is bus, device and endpoint.
local function usb_end(pinfo)
  local from, to = tostring(pinfo.src), tostring(pinfo.dst)
  if to == "host" then return "usb " .. from, true end
  if from == "host" then return "usb " .. to, false end
end

local function begin_packet(pinfo)
  pinfo.cols.protocol = "scanhead"
  pinfo.cols.info:clear()
end

-- Frames that go on in the next packet are joined here, or by TCP where `ask` is given: ask(at, more) tells TCP where
-- to begin. Even then they are joined here if TCP would give bytes again that were taken already, or would cut them
-- at other places at the next look.
local function dissect_joined(tvb, pinfo, tree, conn, is_down, can_wait, ask)
  local side, packet, first_time = is_down and "in" or "out", memo_of(pinfo), not pinfo.visited
  local key = side .. tvb:offset()
  local kept = packet[key]
  if not kept then
    kept = {}
    packet[key] = kept
    local pending = conn.pending[side]
    if first_time and pending then
      pending.n = pending.n + tvb:len()
      pending[#pending + 1] = tvb:raw(0, tvb:len())
      kept.is_part = pending.most and pending.n < pending.most
      if not kept.is_part then kept.joined, conn.pending[side] = table.concat(pending), nil end
    end
  end
  local at, more, is_old = 0, nil, nil
  local all = kept.joined and ByteArray.new(kept.joined, true):tvb("Frames over several packets") or tvb
  if not kept.is_part then
    at, more, is_old = (is_down and run_search or run_commands)(all, pinfo, tree, conn, can_wait)
    if not at then return end
    if first_time then kept.asks = ask and not kept.joined and not is_old end
    if kept.asks then return ask(at, more) end
    local rest = all:raw(at, all:len() - at)
    if first_time then conn.pending[side] = {rest, n = #rest, most = more and #rest + more} end
  end
  tree:add(scanhead, all(at, all:len() - at), "Scan head, part of a frame"):add(F["fragment"], all(at, all:len() - at))
  note_info(pinfo, "[part of a frame]")
end

local function first_header(tvb)
  local bytes = tvb:raw(0, tvb:len())
  local at = next_header(bytes, 0, #bytes)
  return at and at + HEADER_LEN <= #bytes
end

-- A frame's header, or what *IDN? answers: both come from a head alone.
local function is_of_head(tvb)
  return first_header(tvb) or tvb:raw(0, tvb:len()):find("scanhead native 1\r\n", 1, true) ~= nil
end

-- Which side of a TCP connection is the head: the side that frames come from. Until a frame comes, it is the side with
-- the port of the preferences, or, if neither has this port, with the lower port.
local function is_from_head(tvb, pinfo, conn)
  if not conn.head_port and is_of_head(tvb) then conn.head_port = pinfo.src_port end
  if conn.head_port then return pinfo.src_port == conn.head_port end
  local port = scanhead.prefs.port
  if pinfo.src_port == port or pinfo.dst_port == port then return pinfo.src_port == port end
  return pinfo.src_port < pinfo.dst_port
end

-- The side is fixed once a packet was seen.
local function side_of(tvb, pinfo, conn)
  local packet = memo_of(pinfo)
  if packet.side == nil then packet.side = is_from_head(tvb, pinfo, conn) end
  return packet.side
end

local function dissect_tcp(tvb, pinfo, tree)
  local conn = conn_of("tcp " .. tcp_key(pinfo), true)
  begin_packet(pinfo)
  dissect_joined(tvb, pinfo, tree, conn, side_of(tvb, pinfo, conn), true, pinfo.can_desegment > 0 and function(at, more)
    pinfo.desegment_offset, pinfo.desegment_len = at, more or DESEGMENT_ONE_MORE_SEGMENT
  end)
  pinfo.cols.info:fence()
  return tvb:len()
end

local function dissect_usb(tvb, pinfo, tree)
  local key, is_down = usb_end(pinfo)
  begin_packet(pinfo)
  dissect_joined(tvb, pinfo, tree, conn_of(key, true), is_down, true)
end

function scanhead.dissector(tvb, pinfo, tree)
  if pinfo.port_type == PORT_TYPE_TCP then return dissect_tcp(tvb, pinfo, tree) end
  begin_packet(pinfo)
  run_search(tvb, pinfo, tree, conn_of("user0", false), false)
  return tvb:len()
end

local web = Proto("scanhead.ws", "Scan head on WebSocket")
function web.dissector(tvb, pinfo, tree)
  local conn = conn_of("ws " .. tcp_key(pinfo), true)
  local is_down = side_of(tvb, pinfo, conn)
  begin_packet(pinfo)
  dissect_joined(tvb, pinfo, tree, conn, is_down, is_down)
  pinfo.cols.info:fence()
  return tvb:len()
end

-- Any port: a correct header, or what *IDN? answers, is enough.
scanhead:register_heuristic("tcp", function(tvb, pinfo, tree)
  if not is_of_head(tvb) then return false end
  dissect_tcp(tvb, pinfo, tree)
  pinfo.conversation = scanhead
  return true
end)

scanhead:register_heuristic("usb.bulk", function(tvb, pinfo, tree)
  local key = usb_end(pinfo)
  if not key or not conns[key] and not is_of_head(tvb) then return false end
  dissect_usb(tvb, pinfo, tree)
  return true
end)

DissectorTable.get("ws.protocol"):add("scanhead-native-1", web)
local USER0 = wtap and wtap.USER0 or wtap_encaps and wtap_encaps.USER0 or 45

local port
local others = DissectorTable.get("wtap_encap"):get_dissector(USER0) -- Wireshark's own dissector for it
local function register()
  local tcp, encapsulations = DissectorTable.get("tcp.port"), DissectorTable.get("wtap_encap")
  if port then tcp:remove(port, scanhead) end
  port = scanhead.prefs.port
  tcp:add(port, scanhead)
  if scanhead.prefs.user0 then
    encapsulations:add(USER0, scanhead)
  else
    encapsulations:remove(USER0, scanhead)
    if others then encapsulations:add(USER0, others) end
  end
end
register()
scanhead.prefs_changed = register

local function begin_capture() memo, conns = {}, {} end
begin_capture()
scanhead.init = begin_capture
