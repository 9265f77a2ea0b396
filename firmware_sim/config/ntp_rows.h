/* SPDX-License-Identifier: MIT */
/* Rows of the section `ntp`. Private to keys.c. */
/* clang-format off */
    {"ntp", .type = CFG_MAP,
     .help = "The time server that a SICK scanner (protocol: cola) asks. Clients change role, address, update_s and "
             "zone_h by telegrams; at power-up they are those stored in head.settings_file, else those given here."},
    {KEY(ntp.role), CFG_ENUM, .def = "none",
     WORDS([NTP_ROLE_NONE] = "none", [NTP_ROLE_CLIENT] = "client", [NTP_ROLE_SERVER] = "server"),
     .help = "TSCRole. client: the scanner's clock begins with 1970 at power-up, and answers of the server set it; it "
             "needs loop.pace: realtime. server: the variable has this value, and nothing else changes."},
    {KEY(ntp.address), CFG_TEXT, .def = "127.0.0.1", .allowed = "a numeric IPv4 address",
     .help = "TSCTCSrvAddr: the server's address."},
    {KEY(ntp.port), CFG_COUNT, NULL, "123", 1, 65535, .help = "Its UDP port, which no telegram changes."},
    {KEY(ntp.update_s), CFG_COUNT, "s", "600", 1, 86400, .help = "TSCTCupdatetime: time from request to request."},
    {KEY(ntp.zone_h), CFG_REAL, "h", "0", -12, 12, .allowed = "whole hours from -12 to 12",
     .help = "TSCTCtimezone: how far the time that is set is ahead of the server's."},
    {KEY(ntp.max_offset_s), CFG_REAL, "s", "18000", 0.001, 1e9,
     .help = "TSCTCmaxoffset: once the clock is set, an answer that is farther from it is refused."},
    {KEY(ntp.anywhere), CFG_BOOL, .def = "off",
     .help = "on: a client may choose any server. off: only the one of ntp.address, or one at 127.x.x.x, is asked."},
    /* clang-format on */
