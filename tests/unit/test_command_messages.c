/* SPDX-License-Identifier: MIT */
/* Replies of refused commands, each compared whole: number, class as in SCPI-99, what is wrong, and all numbers of what
 * is allowed. The limits are those of command_device.c. */
#include "tests/unit/command_device.h"

struct refused {
    const char *line, *reply;
};

/* The queue has the same text, and nothing else changes. */
static void expect_refused(struct command_device *dev, uint32_t session, const struct refused *rows, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        expect_error(dev, session, rows[i].line, atoi(rows[i].reply + 4), "");
        if (strcmp(result.reply, rows[i].reply) != 0)
            fail_msg("'%s' gives\n%s, not\n%s", rows[i].line, result.reply, rows[i].reply);
    }
}

/* clang-format off */
#define SYNTAX   "ERR -102,\"Syntax error; "
#define TYPE     "ERR -104,\"Data type error; "
#define NOT      "ERR -108,\"Parameter not allowed; "
#define MISSING  "ERR -109,\"Missing parameter; "
#define HEADER   "ERR -113,\"Undefined header; "
#define SUFFIX   "ERR -131,\"Invalid suffix; "
#define CONFLICT "ERR -221,\"Settings conflict; "
#define RANGE    "ERR -222,\"Data out of range; "
static const struct refused forms[] = {
    {"*IDN?;*RST", SYNTAX "one command per line, no ';'\""},
    {"?", SYNTAX "a command begins with a letter, ':' or '*'\""},
    {"HEAD:PRR~", SYNTAX "a blank must follow the header\""},
    {"FOO", HEADER "'FOO'; HELP? and HELP:SETtings? list all\""},
    {"HEAD:STAT 2", HEADER "HEAD:STATe is only a query, HEAD:STATe?\""},
    {"TIME:STEP?", HEADER "TIME:STEP has no query form\""},
    {"*RST 1", NOT "*RST takes no parameter\""},
    {"HEAD:PRR 1,2", NOT "HEAD:PRR takes one value\""},
    {"HEAD:PRR? 5", NOT "HEAD:PRR? takes no parameter but MIN, MAX or DEF\""},
    {"HEAD:STAT? MAX", NOT "HEAD:STATe? takes no parameter\""},
    {"HEAD:PRR", MISSING "HEAD:PRR takes a number\""},
    {"SCAN:ECH", MISSING "SCAN:ECHoes takes a word\""},
    {"FAUL:ADD", MISSING "FAULt:ADD takes a fault or its number\""},
    {"TIME:SERV", MISSING "TIME:SERVer takes a role, address, s, h and interface\""},
    {"SCAN:REPL", MISSING "SCAN:REPLay takes a time, speed or loop\""},
    {"SITE:POSE", MISSING "SITE:POSE takes a station and its place\""},
    {"HEAD:PRR fast", TYPE "HEAD:PRR takes a number, MIN, MAX or DEF, not 'fast'\""},
    {"TIME:STEP MAX", TYPE "TIME:STEP takes a number, not 'MAX'\""},
    {"SCAN:ECH SOME", TYPE "SCAN:ECHoes takes ALL, FIRSt, LAST, STRongest, DEF, not 'SOME'\""},
    {"HEAD:NOIS LOUD", TYPE "HEAD:NOISe takes OFF, ON, SIGNal, DEF, not 'LOUD'\""},
    {"HEAD:PRR 300000 DEG", SUFFIX "'DEG'; HEAD:PRR takes HZ, KHZ or MHZ\""},
    {"HELP? FOO", TYPE "HELP? takes a header, not 'FOO'; HELP? and HELP:SETtings? list them\""},
};
static const struct refused values[] = {
    {"HEAD:PRR 999", RANGE "HEAD:PRR 999 Hz, allowed 1000 to 1200000\""},
    {"HEAD:PRR 1e30", RANGE "HEAD:PRR 1e30, allowed 1000 to 1200000\""},
    {"HEAD:PRR 1000.0000001", RANGE "HEAD:PRR 1000.0000001, allowed multiples of 0.000001 Hz\""},
    {"SCAN:FRAM 1.5", RANGE "SCAN:FRAMes 1.5, allowed whole numbers\""},
    {"SCAN:FRAM 1000001", RANGE "SCAN:FRAMes 1000001, allowed 0 to 1000000\""},
    {"TIME:STEP 0.5", RANGE "TIME:STEP 0.5, allowed whole numbers of ns\""},
    {"TIME:STEP 86400000000001", RANGE "TIME:STEP 86400000000001 ns, allowed 1 to 86400000000000\""},
    {"TIME:STEP 5", CONFLICT "TIME:STEP needs the pace step\""},
    {"HEAD:LIN 1000.5;", SYNTAX "one command per line, no ';'\""},
    {"SCAN:LINE:STAR 50", CONFLICT "SCAN:LINE:STARt 50 deg, allowed -40 to 49.999999 as SCAN:LINE:STOP is 50\""},
    {"SCAN:LINE:STOP -30", CONFLICT "SCAN:LINE:STOP -30 deg, allowed -29.999999 to 60 as SCAN:LINE:STARt is -30\""},
    {"SCAN:PAN:STAR 180", CONFLICT "SCAN:PAN:STARt 180 deg, allowed -180 to 179.999999 as SCAN:PAN:STOP is 180\""},
    {"SCAN:PAN:STOP 0", CONFLICT "SCAN:PAN:STOP 0 deg, allowed 0.000001 to 360 as SCAN:PAN:STARt is 0\""},
    {"HEAD:RANG:MIN 260", RANGE "HEAD:RANGe:MIN 260 m, allowed 0.5 to 250\""},
    {"HEAD:RANG:MAX 1.5", RANGE "HEAD:RANGe:MAX 1.5 m, allowed 2 to 800\""},
    {"HEAD:STATION 4", RANGE "HEAD:STATION 4, allowed 1 to 3\""},
    {"HEAD:NOIS SIGN", CONFLICT "HEAD:NOISe SIGNal needs signal.model: on\""},
    {"HEAD:PHAS:LOCK ON", CONFLICT "HEAD:PHASe:LOCK ON needs a head profile with emitter: beams\""},
    {"SCAN:WAV ON", CONFLICT "SCAN:WAVeform ON needs waveform.send: on in the configuration\""},
    {"HEAD:STOR", CONFLICT "HEAD:STORe needs head.settings_file in the configuration, and no journal that is replayed\""},
    {"SCAN:STOP", CONFLICT "SCAN:STOP is not possible in state idle\""},
};
static const struct refused owners[] = {
    {"FAUL:ADD drop", TYPE "FAULt:ADD takes a fault as {kind: drop, every: 10}\""},
    {"FAUL:ADD {kind: dorp}", RANGE "fault:1: faults[0]: unknown\""},
    {"FAUL:CLE 2", RANGE "FAULt:CLEar: there is no fault 2; FAULt:LIST? lists the faults\""},
    {"FAUL:INJ? 3", RANGE "FAULt:INJected: there is no fault 3; FAULt:LIST? lists the faults\""},
    {"FAUL:CLE 0", TYPE "FAULt:CLEar takes the number of a fault or ALL, not '0'\""},
    {"FAUL:INJ? 4294967296", TYPE "FAULt:INJected takes the number of a fault or ALL, not '4294967296'\""},
    {"SCAN:REPL? 1", NOT "SCAN:REPLay? takes no parameter\""},
    {"SCAN:REPL a", TYPE "SCAN:REPLay: the time is not a number: 'a'\""},
    {"SCAN:REPL ,b", TYPE "SCAN:REPLay: the speed is not a number: 'b'\""},
    {"SCAN:REPL ,,maybe", TYPE "SCAN:REPLay: the loop is ON or OFF, not 'maybe'\""},
    {"SCAN:REPL 1,1,ON,1", NOT "SCAN:REPLay takes a time, a speed, and ON or OFF\""},
    {"SCAN:REPL -1", RANGE "SCAN:REPLay: time -1, allowed 0 to 1000000000\""},
    {"SCAN:REPL ,1001", RANGE "SCAN:REPLay: speed 1001, allowed 0 to 1000\""},
    {"SCAN:REPL ,0.009", RANGE "SCAN:REPLay: speed 0.009, allowed 0 (it pauses) and 0.01 to 1000\""},
    {"SITE:POSE? ", MISSING "SITE:POSE? takes a station\""},
    {"SITE:POSE? 1,2", NOT "SITE:POSE? takes a station, and MIN, MAX or DEF\""},
    {"SITE:POSE? one", TYPE "SITE:POSE: station is not a number: 'one'\""},
    {"SITE:POSE? 4", RANGE "SITE:POSE: station 4, allowed 1 to 3\""},
    {"SITE:POSE 1.5,0,0,0,0,0,0", RANGE "SITE:POSE: station 1.5, allowed whole numbers 1 to 3\""},
    {"SITE:POSE 1", MISSING "SITE:POSE takes station, x, y, z, heading, pitch, roll; x is missing\""},
    {"SITE:POSE 1,0,0,0,0,0", MISSING "SITE:POSE takes station, x, y, z, heading, pitch, roll; roll is missing\""},
    {"SITE:POSE 1,0,0,0,0,0,0,0", NOT "SITE:POSE takes station, x, y, z, heading, pitch, roll, or station, DEF\""},
    {"SITE:POSE 1,MAX", TYPE "SITE:POSE: a place is six numbers or DEF, not 'MAX'\""},
    {"SITE:POSE 1,0,nan,0,0,0,0", TYPE "SITE:POSE: y is not a number: 'nan'\""},
    {"SITE:POSE 1,0,0,1 2,0,0,0", TYPE "SITE:POSE: z is not a number: '1 2'\""},
    {"SITE:POSE 1,0,0,0,0 M,0,0", SUFFIX "'M'; heading of SITE:POSE takes DEG\""},
    {"SITE:POSE 1,0 DEG,0,0,0,0,0", SUFFIX "'DEG'; x of SITE:POSE takes M\""},
    {"SITE:POSE 1,1000000001,0,0,0,0,0", RANGE "SITE:POSE: x 1000000001, allowed -1000000000 to 1000000000 m\""},
    {"SITE:POSE 1,0,0,0,360.1,0,0", RANGE "SITE:POSE: heading 360.1, allowed -360 to 360 deg\""},
    {"SITE:POSE 1,0,0,0,0,-90.5,0", RANGE "SITE:POSE: pitch -90.5, allowed -90 to 90 deg\""},
    {"SITE:POSE 1,0,0,0,0,0,181", RANGE "SITE:POSE: roll 181, allowed -180 to 180 deg\""},
    {"SITE:POSE 1,0000000000000000000000000000000000000000000000000000000000000000,0,0,0,0,0",
     RANGE "SITE:POSE: x has 64 characters, allowed up to 63\""},
    {"TIME:SERV? ALL", NOT "TIME:SERVer? takes no parameter but STATe, not 'ALL'\""},
    {"TIME:SERV CLIENT", TYPE "TIME:SERVer takes a role, an address, s, h and an interface, as CLIENT,127.0.0.1,600,0,ETH\""},
    {"TIME:SERV NONE,127.0.0.1,0,0,ETH",
     RANGE "TIME:SERVer: allowed are NONE, CLIENT, SERVER; 0 to 255; 1 to 86400 s; -12 to 12 h; ETH, CAN\""},
    {"TIME:SERV CLIENT,127.0.0.1,600,0,ETH", CONFLICT "TIME:SERVer CLIENT needs the pace realtime, and no journal that is replayed\""},
    {"TIME:SHIF 1e19", RANGE "TIME:SHIFt 1e19, allowed -4600000000000000000 to 4600000000000000000\""},
};
/* clang-format on */

static void lines_are_refused_word_by_word(void **state)
{
    (void)state;
    struct command_device dev = command_test_device();
    expect_refused(&dev, 1, forms, N_OF(forms));
    expect_refused(&dev, 1, values, N_OF(values));
    expect_refused(&dev, 1, owners, N_OF(owners));
}

/* The device answers first that it lacks something or is busy, and then that a line asks for something wrong. */
static void devices_refuse_word_by_word(void **state)
{
    (void)state;
    static const char long_line[] = "ERR -363,\"Input buffer overrun; the line is longer than 256 characters\"";
    struct command_device dev = command_test_device();
    char line[COMMAND_MAX_LINE + 2];
    memset(line, ' ', sizeof line - 1);
    line[sizeof line - 1] = '\0';
    expect_refused(&dev, 1, &(struct refused){line, long_line}, 1);
    dev.control = 2;
    expect_refused(&dev, 1,
                   (const struct refused[]){
                       {"HEAD:PRR 5000", "ERR -203,\"Command protected; session 2 has control, this is session 1\""}},
                   1);
    command_set_peer(&dev, 2, "tcp:x");
    expect_refused(
        &dev, 1,
        (const struct refused[]){
            {"HEAD:PRR 5000", "ERR -203,\"Command protected; tcp:x has control (session 2), this is session 1\""}},
        1);
    dev.control = 0;
    dev.utc[0] = dev.gps[0] = dev.ptp[0] = '\0';
    expect_refused(&dev, 1,
                   (const struct refused[]){
                       {"TIME:UTC?", CONFLICT "TIME:UTC? needs time.epoch in the configuration\""},
                       {"TIME:GPS?", CONFLICT "TIME:GPS? needs time.epoch in the configuration\""},
                       {"TIME:PTP?", CONFLICT "TIME:PTP? needs time.ptp.follower: on in the configuration\""}},
                   3);
    dev.step_allowed = 1;
    expect_refused(&dev, 1,
                   (const struct refused[]){
                       {"TIME:STEP 5,1,2,3,0,0,0", CONFLICT "a pose in TIME:STEP needs platform.kind: live\""}},
                   1);
    dev.pose_allowed = 1;
    dev.pose_reach_m = 7.5;
    expect_refused(
        &dev, 1,
        (const struct refused[]){
            {"TIME:STEP 5,1,2", MISSING "TIME:STEP takes a time, or a time and x, y, z, roll, pitch, heading\""},
            {"TIME:STEP 5,1,2,3,0,0,0,0", NOT "TIME:STEP takes a time, or a time and x, y, z, roll, pitch, heading\""},
            {"TIME:STEP 5,1,2,3,0,91,0", RANGE "TIME:STEP: pitch 91, allowed -90 to 90 deg\""},
            {"TIME:STEP 5,1,2,3,361,0,0", RANGE "TIME:STEP: roll 361, allowed -360 to 360 deg\""},
            {"TIME:STEP 5,7,3,0,0,0,0",
             RANGE "TIME:STEP: the pose is more than platform.reach_m, 7.5 m, from the station\""}},
        5);
    expect(&dev, "TIME:STEP 5,4.5,6,0,0,0,0", "OK"); /* 7.5 m away */
    dev.moving = 2;
    expect_refused(
        &dev, 1,
        (const struct refused[]){{"SITE:POSE 1,0,0,0,0,0,0", CONFLICT "SITE:POSE: station 2 is being moved\""},
                                 {"SCAN:STAR", CONFLICT "SCAN:STARt waits for SITE:POSE: station 2 is being moved\""}},
        2);
    dev.moving = 0;
    dev.state = HEAD_SCANNING;
    expect_refused(
        &dev, 1,
        (const struct refused[]){{"SITE:POSE 1,0,0,0,0,0,0", CONFLICT "SITE:POSE is not possible in state scanning\""},
                                 {"HEAD:STATION 2", CONFLICT "HEAD:STATION can't change in state scanning\""}},
        2);
    dev.state = HEAD_FAULT;
    dev.why_fault = "the mirror stands";
    expect_refused(&dev, 1,
                   (const struct refused[]){
                       {"SCAN:STAR", CONFLICT "SCAN:STARt is not possible in state fault: the mirror stands\""}},
                   1);
    dev.state = HEAD_IDLE;
    dev.limits.elsewhere = 2;
    expect_refused(
        &dev, 1,
        (const struct refused[]){
            {"SITE:POSE 2,0,0,0,0,0,0", CONFLICT "SITE:POSE: station 2 has another scanner\""},
            {"HEAD:STATION 2", CONFLICT "HEAD:STATION 2 has another scanner; run that: --set head.station=2\""}},
        2);
    dev.fixed = "it flies";
    dev.place = NULL;
    dev.faults = NULL;
    dev.replay.fixed_speed = "its protocol has times";
    expect_refused(
        &dev, 1,
        (const struct refused[]){{"SITE:POSE 1,0,0,0,0,0,0", CONFLICT "SITE:POSE: it flies\""},
                                 {"SITE:POSE? 1", CONFLICT "SITE:POSE?: the place is not known\""},
                                 {"FAUL:ADD {kind: drop}", CONFLICT "FAULt:ADD: this head has no faults\""},
                                 {"FAUL:CLE 1", CONFLICT "FAULt:CLEar: this head has no faults\""},
                                 {"FAUL:INJ?", CONFLICT "FAULt:INJected: this head has no faults\""},
                                 {"FAUL:LIST?", CONFLICT "FAULt:LIST: this head has no faults\""},
                                 {"SCAN:REPL ,2", CONFLICT "SCAN:REPLay: the speed is 1: its protocol has times\""}},
        7);
    dev.replay = (struct command_replay){.length_s = 12.5};
    expect_refused(
        &dev, 1,
        (const struct refused[]){{"SCAN:REPL 13", RANGE "SCAN:REPLay: time 13, allowed 0 to 12.5\""},
                                 {"SCAN:REPL 1", CONFLICT "SCAN:REPLay needs a recording that is replayed\""}},
        2);
    dev.limits.noise_most = 0;
    expect_refused(&dev, 1,
                   (const struct refused[]){{"HEAD:NOIS ON", CONFLICT "HEAD:NOISe ON needs waveform.echoes: model\""}},
                   1);
    dev.limits.angle_most = 0;
    expect_refused(
        &dev, 1,
        (const struct refused[]){{"HEAD:NOIS:ANGL ON", CONFLICT
                                  "HEAD:NOISe:ANGLe ON needs mirror_sigma_deg or pan_sigma_deg of the head profile\""}},
        1);
    dev.recorded = "a recording is replayed";
    expect_refused(
        &dev, 1,
        (const struct refused[]){
            {"HEAD:PRR 5000", CONFLICT "HEAD:PRR: a recording is replayed; it is 300000\""},
            {"HEAD:REB", CONFLICT "HEAD:REBoot: a recording is replayed\""},
            {"TIME:SHIF 5", CONFLICT "TIME:SHIFt: a recording is replayed\""},
            {"TIME:SERV NONE,127.0.0.1,600,0,ETH", CONFLICT "TIME:SERVer: a recording is replayed\""},
            {"TIME:UTC?",
             CONFLICT "TIME:UTC? is not answered in a replay; telemetry has the value, if the recorded head had it\""}},
        5);
}

/* Ranges and noise are planned, so they can't change in a scan, and neither can the station. HELP? says so, too. */
static void settings_rest_in_a_scan_or_do_not(void **state)
{
    (void)state;
    static const struct {
        const char *header, *value;
        int rests;
    } rows[] = {{"HEAD:PRR", "5000", 0},         {"HEAD:LINes", "50", 0},       {"HEAD:PAN", "5", 0},
                {"HEAD:STATION", "2", 1},        {"SCAN:LINE:STARt", "-20", 0}, {"SCAN:LINE:STOP", "40", 0},
                {"SCAN:PAN:STARt", "5", 0},      {"SCAN:PAN:STOP", "100", 0},   {"SCAN:FRAMes", "3", 0},
                {"SCAN:ECHoes", "FIRSt", 0},     {"SCAN:WAVeform", "ON", 0},    {"HEAD:RANGe:MIN", "3", 1},
                {"HEAD:RANGe:MAX", "30", 1},     {"HEAD:NOISe", "ON", 1},       {"HEAD:NOISe:ANGLe", "ON", 1},
                {"HEAD:NOISe:SIGMa", "0.25", 1}, {"HEAD:NOISe:BALL", "0.5", 1}, {"HEAD:PHASe", "5", 0},
                {"HEAD:PHASe:LOCK", "ON", 0}};
    static const enum head_state scans[] = {HEAD_SPIN_UP, HEAD_SCANNING};
    for (size_t i = 0; i < N_OF(rows); i++)
        for (int k = 0; k < 2; k++) {
            struct command_device dev = command_test_device();
            char line[64], want[160];
            dev.limits.waves_most = dev.limits.phase_lock_most = 1;
            snprintf(line, sizeof line, "HELP? %s", rows[i].header);
            const char *help = say(&dev, 1, line);
            assert_int_equal(strstr(help, "\"all\"") == NULL, rows[i].rests);
            if (rows[i].rests) assert_non_null(strstr(help, "\"off boot idle spin-down fault\""));
            dev.state = scans[k];
            snprintf(line, sizeof line, "%s %s", rows[i].header, rows[i].value);
            snprintf(want, sizeof want, CONFLICT "%s can't change in state %s\"", rows[i].header,
                     head_state_name(dev.state));
            if (rows[i].rests) {
                expect_refused(&dev, 1, &(struct refused){line, want}, 1);
                continue;
            }
            const struct head_settings before = dev.settings;
            expect(&dev, line, "OK");
            assert_memory_not_equal(&before, &dev.settings, sizeof before);
            snprintf(line, sizeof line, "%s?", rows[i].header);
            expect(&dev, line, rows[i].value);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_are_refused_word_by_word),
        cmocka_unit_test(settings_rest_in_a_scan_or_do_not),
        cmocka_unit_test(devices_refuse_word_by_word),
    };
    return cmocka_run_group_tests_name("messages of commands", tests, NULL, NULL);
}
