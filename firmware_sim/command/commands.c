/* SPDX-License-Identifier: MIT */
/* The only list of commands, and the function of each. The common part of settings is in setting.c. */
#include "firmware_sim/command/call.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/command/fault_commands.h"
#include "firmware_sim/command/help.h"
#include "firmware_sim/command/row.h"
#include "firmware_sim/command/scan_replay.h"
#include "firmware_sim/command/setting.h"
#include "firmware_sim/command/site_pose.h"
#include "firmware_sim/command/step.h"
#include "firmware_sim/command/time_server.h"

#include <string.h>

/* clang-format off */
#define SETTING(field) offsetof(struct head_settings, field)
#define PROFILE(field) {1, (int64_t)offsetof(struct head_limits, field)}
#define CONSTANT(n)    {0, (n)}
#define NO_OTHER       NULL, 0, 0, 0, 0

enum { TURN_UDEG = 360000000 };
#define TURN_NDEG INT64_C(360000000000)
#define NM_PER_M  INT64_C(1000000000)

static const struct command_unit unit_hz = {"Hz", 6, "HZ, KHZ or MHZ", {{"HZ", 0}, {"KHZ", 3}, {"MHZ", 6}}, NULL};
static const struct command_unit unit_deg = {"deg", 6, "DEG", {{"DEG", 0}}, NULL};
static const struct command_unit unit_deg_s = {"deg/s", 6, "DEG/S", {{"DEG/S", 0}}, NULL};
static const struct command_unit unit_ns = {"ns", 0, "NS, US, MS or S",
                                            {{"NS", 0}, {"US", 3}, {"MS", 6}, {"S", 9}}, NULL};
static const struct command_unit unit_fine_deg = {"deg", 9, "DEG", {{"DEG", 0}}, NULL};
static const struct command_unit unit_m = {"m", 9, "M, MM or KM", {{"M", 0}, {"MM", -3}, {"KM", 3}}, NULL};
static const struct command_unit unit_count = {"", 0, "no unit", {{NULL, 0}}, NULL};
static const struct command_unit unit_fault = {"", 0, "no unit", {{NULL, 0}}, "fault or its number"};
static const struct command_unit unit_server = {"s, h", 0, "no unit", {{NULL, 0}}, "role, address, s, h and interface"};
static const struct command_unit unit_replay = {"s", 0, "no unit", {{NULL, 0}}, "time, speed or loop"};
static const struct command_unit unit_place = {"m, deg", 0, "M, DEG", {{NULL, 0}}, "station and its place"};

enum { PRR, LINES, PAN, STATION, LINE_START, LINE_STOP, PAN_START, PAN_STOP, FRAMES, ECHOES, RANGE_MIN, RANGE_MAX,
       NOISE, ANGLE, SIGMA, BALL, PHASE, PHASE_LOCK, STEP, STEP_LINE, STEP_PAN, WAVES };

/* In the order of enum beam_select. */
static const char *const echo_words[] = {"ALL", "FIRSt", "LAST", "STRongest", NULL};
/* In the order of enum config_range_noise. */
static const char *const noise_words[] = {"OFF", "ON", "SIGNal", NULL};
static const char *const switch_words[] = {"OFF", "ON", NULL};

/* A pulse rate below the line rate would leave lines without a pulse. A line or a pan sweep without width has
 * nothing to scan. A pan sweep beyond a turn would scan things twice. */
static const struct command_setting settings[] = {
    /* field, is_u32, not_in_scan, min, max, other, its field, least, most, is_rate, words, derived */
    [PRR] = {SETTING(prr_uhz), 0, 0, PROFILE(prr_min_uhz), PROFILE(prr_max_uhz),
             "HEAD:LINes", SETTING(lines_uhz), 0, COMMAND_UNBOUND, 1, NULL, NULL},
    [LINES] = {SETTING(lines_uhz), 0, 0, PROFILE(lines_min_uhz), PROFILE(lines_max_uhz),
               "HEAD:PRR", SETTING(prr_uhz), COMMAND_UNBOUND, 0, 0, NULL, NULL},
    [PAN] = {SETTING(pan_udeg_s), 0, 0, CONSTANT(0), PROFILE(pan_max_udeg_s), NO_OTHER, NULL, NULL},
    [STATION] = {SETTING(station), 1, 1, CONSTANT(1), PROFILE(n_stations), NO_OTHER, NULL, NULL},
    [LINE_START] = {SETTING(line_start_udeg), 0, 0, PROFILE(fov_min_udeg), PROFILE(fov_max_udeg),
                    "SCAN:LINE:STOP", SETTING(line_stop_udeg), COMMAND_UNBOUND, -1, 0, NULL, NULL},
    [LINE_STOP] = {SETTING(line_stop_udeg), 0, 0, PROFILE(fov_min_udeg), PROFILE(fov_max_udeg),
                   "SCAN:LINE:STARt", SETTING(line_start_udeg), 1, COMMAND_UNBOUND, 0, NULL, NULL},
    [PAN_START] = {SETTING(pan_start_udeg), 0, 0, PROFILE(pan_min_udeg), PROFILE(pan_max_udeg),
                   "SCAN:PAN:STOP", SETTING(pan_stop_udeg), -TURN_UDEG, -1, 0, NULL, NULL},
    [PAN_STOP] = {SETTING(pan_stop_udeg), 0, 0, PROFILE(pan_min_udeg), PROFILE(pan_max_udeg),
                  "SCAN:PAN:STARt", SETTING(pan_start_udeg), 1, TURN_UDEG, 0, NULL, NULL},
    [FRAMES] = {SETTING(frames), 1, 0, CONSTANT(0), CONSTANT(HEAD_MAX_FRAMES), NO_OTHER, NULL, NULL},
    [ECHOES] = {SETTING(echoes), 1, 0, CONSTANT(0), CONSTANT(3), NO_OTHER, echo_words, NULL},
    [WAVES] = {SETTING(waves), 1, 0, CONSTANT(0), PROFILE(waves_most), NO_OTHER, switch_words, NULL},
    [RANGE_MIN] = {SETTING(range_min_nm), 0, 1, PROFILE(range_min_nm), PROFILE(near_most_nm),
                   "HEAD:RANGe:MAX", SETTING(range_max_nm), COMMAND_UNBOUND, -1, 0, NULL, NULL},
    [RANGE_MAX] = {SETTING(range_max_nm), 0, 1, PROFILE(far_least_nm), PROFILE(range_max_nm),
                   "HEAD:RANGe:MIN", SETTING(range_min_nm), 1, COMMAND_UNBOUND, 0, NULL, NULL},
    [NOISE] = {SETTING(noise), 1, 1, CONSTANT(0), PROFILE(noise_most), NO_OTHER, noise_words, NULL},
    [ANGLE] = {SETTING(angle_noise), 1, 1, CONSTANT(0), PROFILE(angle_most), NO_OTHER, switch_words, NULL},
    [SIGMA] = {SETTING(sigma_nm), 0, 1, PROFILE(sigma_min_nm), CONSTANT(10 * NM_PER_M), NO_OTHER, NULL, NULL},
    [BALL] = {SETTING(ball_nm), 0, 1, CONSTANT(0), PROFILE(ball_max_nm), NO_OTHER, NULL, NULL},
    [PHASE] = {SETTING(phase_udeg), 0, 0, CONSTANT(0), CONSTANT(TURN_UDEG - 1), NO_OTHER, NULL, NULL},
    [PHASE_LOCK] = {SETTING(phase_lock), 1, 0, CONSTANT(0), PROFILE(phase_lock_most), NO_OTHER, switch_words, NULL},
    [STEP] = {0, 0, 0, CONSTANT(1), CONSTANT(TURN_NDEG), NO_OTHER, NULL, &command_step_both},
    [STEP_LINE] = {0, 0, 0, CONSTANT(1), CONSTANT(TURN_NDEG), NO_OTHER, NULL, &command_step_line},
    [STEP_PAN] = {0, 0, 0, CONSTANT(0), CONSTANT(TURN_NDEG), NO_OTHER, NULL, &command_step_pan},
};
/* clang-format on */

static int query_idn(struct command_call *call)
{
    return command_reply(call, "%s", call->dev->idn);
}

static int query_opc(struct command_call *call)
{
    return command_reply(call, "1"); /* each command is complete before its reply goes out */
}

static int query_stb(struct command_call *call)
{
    const int errors = call->dev->queue.count > 0 ? 1 << 2 : 0;
    const int operation = call->dev->state == HEAD_SCANNING ? 1 << 7 : 0;
    return command_reply(call, "%d", errors | operation);
}

static int query_error(struct command_call *call)
{
    command_queue_pop(&call->dev->queue, call->out->reply, sizeof call->out->reply);
    return 0;
}

static int query_error_count(struct command_call *call)
{
    return command_reply(call, "%u", call->dev->queue.count);
}

static int query_plan(struct command_call *call)
{
    return command_reply(call, "%s", call->dev->plan != NULL ? call->dev->plan : "not known");
}

static int query_lost(struct command_call *call)
{
    return command_reply(call, "%llu,%llu", (unsigned long long)call->dev->lost_journal_lines,
                         (unsigned long long)call->dev->lost_truth_lines);
}

static int query_version(struct command_call *call)
{
    return command_reply(call, "1999.0");
}

static int query_control(struct command_call *call)
{
    return command_reply(call, "%u", call->dev->control);
}

static int query_control_who(struct command_call *call)
{
    return command_reply(call, "\"%s\"", command_peer(call->dev, call->dev->control));
}

static int query_state(struct command_call *call)
{
    return command_reply(call, "%s", head_state_name(call->dev->state));
}

/* Replies with whether the lock holds the rotor, and its azimuth at the last pulse per second. Where no such
 * pulse has come since the rotor began to turn, the reply is NONE, and no error. */
static int query_phase_edge(struct command_call *call)
{
    const struct command_phase *phase = &call->dev->phase;
    if (!phase->is_known) return command_reply(call, "NONE");
    return command_reply(call, "%s,%lld.%06lld", phase->is_held ? "LOCKED" : "FREE",
                         (long long)(phase->edge_udeg / 1000000), (long long)(phase->edge_udeg % 1000000));
}

static int query_count(struct command_call *call)
{
    return command_reply(call, "%llu", (unsigned long long)call->dev->frames_done);
}

static int query_time(struct command_call *call)
{
    return command_reply(call, "%lld", (long long)call->dev->t_ns);
}

/* An empty text means that the head does not know the time. */
static int reply_time_of_day(struct command_call *call, const char *text, const char *needs)
{
    if (text[0] == '\0')
        return command_fail(call, CMD_E_SETTINGS, "%s? %s", call->row->header,
                            call->dev->recorded != NULL
                                ? "is not answered in a replay; telemetry has the value, if the recorded head had it"
                                : needs);
    return command_reply(call, "%s", text);
}

static const char NEEDS_EPOCH[] = "needs time.epoch in the configuration";

static int query_utc(struct command_call *call)
{
    return reply_time_of_day(call, call->dev->utc, NEEDS_EPOCH);
}

static int query_gps(struct command_call *call)
{
    return reply_time_of_day(call, call->dev->gps, NEEDS_EPOCH);
}

static int query_ptp(struct command_call *call)
{
    return reply_time_of_day(call, call->dev->ptp, "needs time.ptp.follower: on in the configuration");
}

static int act_clear(struct command_call *call)
{
    memset(&call->dev->queue, 0, sizeof call->dev->queue);
    return command_reply(call, "OK");
}

static int query_session(struct command_call *call)
{
    return command_reply(call, "%u", call->session);
}

static int act_take(struct command_call *call)
{
    return command_accept(call, COMMAND_TAKE);
}

static int act_release(struct command_call *call)
{
    if (call->dev->control != 0) call->out->effect = COMMAND_RELEASE;
    call->dev->control = 0;
    return command_reply(call, "OK");
}

/* Sets the effect; or fails with -221 where the state machine refuses the row's event. */
static int act_event(struct command_call *call, enum command_effect effect)
{
    const enum head_event event = (enum head_event)(call->row->event - 1);
    const char *why = call->dev->state == HEAD_FAULT ? call->dev->why_fault : NULL;
    if (head_next_state(call->dev->state, event) < 0)
        return command_fail(call, CMD_E_SETTINGS, "%s is not possible in state %s%s%s", call->row->header,
                            head_state_name(call->dev->state), why != NULL ? ": " : "", why != NULL ? why : "");
    return command_accept(call, effect);
}

static int act_start(struct command_call *call)
{
    if (call->dev->moving != 0)
        return command_fail(call, CMD_E_SETTINGS, "%s waits for SITE:POSE: station %u is being moved",
                            call->row->header, call->dev->moving);
    if (call->dev->recorded == NULL) return act_event(call, COMMAND_START);
    return command_accept(call, COMMAND_START); /* the recording begins anew */
}

/* Journals of earlier heads may stop a scan again while its last pulses are on their way: these heads took that. */
static int act_stop(struct command_call *call)
{
    const int again = call->session == 0 && call->dev->stops;
    return call->dev->is_played || again ? command_accept(call, COMMAND_STOP) : act_event(call, COMMAND_STOP);
}

static int act_reset(struct command_call *call)
{
    if (act_event(call, COMMAND_RESET) != 0) return -1;
    call->dev->settings = call->dev->defaults;
    command_server_set(call->dev, &call->dev->server_default);
    return 0;
}

static int act_reboot(struct command_call *call)
{
    if (call->dev->recorded != NULL)
        return command_fail(call, CMD_E_SETTINGS, "%s: %s", call->row->header, call->dev->recorded);
    return act_event(call, COMMAND_REBOOT);
}

/* From now on the head powers up with the present settings; the device writes them to its file. Station and frames are
 * left out (stored.h). */
static int act_store(struct command_call *call)
{
    struct command_device *dev = call->dev;
    if (!dev->keeps)
        return command_fail(call, CMD_E_SETTINGS,
                            "%s needs head.settings_file in the configuration, and no journal that is replayed",
                            call->row->header);
    const uint32_t station = dev->defaults.station, frames = dev->defaults.frames;
    dev->defaults = dev->settings;
    dev->defaults.station = station;
    dev->defaults.frames = frames;
    dev->server_default = dev->server;
    return command_accept(call, COMMAND_STORE);
}

static int act_step(struct command_call *call)
{
    int64_t step_ns;
    const int64_t day_ns = 86400000000000; /* the most of one step: it cannot be taken back */
    if (command_value_in_range(call, 1, day_ns, &step_ns) != 0) return -1;
    if (call->pose != NULL && command_take_pose(call) != 0) return -1;
    if (!call->dev->step_allowed)
        return command_fail(call, CMD_E_SETTINGS, "%s needs the pace step", call->row->header);
    call->out->effect = COMMAND_STEP;
    call->out->step_ns = step_ns;
    return command_reply(call, "OK");
}

/* clang-format off */
#define QUERY(header, query)       {header, query, NULL, NULL, NULL, 0, 0, 0, 0, 0}
#define ACTION(header, act, open)  {header, NULL, act, NULL, NULL, open, 0, 0, 0, 0}
#define CHANGE(header, act, event) {header, NULL, act, NULL, NULL, 0, 0, 0, 0, (event) + 1}
#define VALUE(header, unit, which) \
    {header, command_setting_query, command_setting_change, &(unit), &settings[which], 0, 0, 0, 0, 0}

const struct command_row command_rows[] = {
    QUERY("*IDN", query_idn),
    CHANGE("*RST", act_reset, HEAD_EV_RESET),
    ACTION("*CLS", act_clear, 1), /* open to all, since SYSTem:ERRor? empties the queue too */
    QUERY("*OPC", query_opc),
    QUERY("*STB", query_stb),
    QUERY("SYSTem:ERRor[:NEXT]", query_error),
    QUERY("SYSTem:ERRor:COUNt", query_error_count),
    QUERY("SYSTem:LOST", query_lost),
    QUERY("SYSTem:VERSion", query_version),
    QUERY("SYSTem:CONTrol", query_control),
    QUERY("SYSTem:CONTrol:WHO", query_control_who),
    QUERY("SYSTem:PLAN", query_plan),
    ACTION("SYSTem:CONTrol:TAKE", act_take, 0),
    ACTION("SYSTem:CONTrol:RELease", act_release, 0),
    QUERY("SYSTem:SESSion", query_session),
    VALUE("HEAD:PRR", unit_hz, PRR),
    VALUE("HEAD:LINes", unit_hz, LINES),
    VALUE("HEAD:PAN", unit_deg_s, PAN),
    QUERY("HEAD:STATe", query_state),
    /* Open to sessions without control: clients of a maker's protocol know nothing of control. Anybody can also pull
     * the plug of a real head. */
    {"HEAD:REBoot", NULL, act_reboot, NULL, NULL, 1, 0, 0, 0, HEAD_EV_POWER_OFF + 1},
    ACTION("HEAD:STORe", act_store, 0),
    VALUE("HEAD:STATION", unit_count, STATION), /* no short form: STAT is STATe */
    VALUE("HEAD:RANGe:MIN", unit_m, RANGE_MIN),
    VALUE("HEAD:RANGe:MAX", unit_m, RANGE_MAX),
    VALUE("HEAD:NOISe", unit_count, NOISE),
    VALUE("HEAD:NOISe:ANGLe", unit_count, ANGLE),
    VALUE("HEAD:NOISe:SIGMa", unit_m, SIGMA),
    VALUE("HEAD:NOISe:BALL", unit_m, BALL),
    VALUE("HEAD:PHASe", unit_deg, PHASE),
    VALUE("HEAD:PHASe:LOCK", unit_count, PHASE_LOCK),
    QUERY("HEAD:PHASe:EDGE", query_phase_edge),
    VALUE("SCAN:STEP", unit_fine_deg, STEP),
    VALUE("SCAN:STEP:LINE", unit_fine_deg, STEP_LINE),
    VALUE("SCAN:STEP:PAN", unit_fine_deg, STEP_PAN),
    VALUE("SCAN:LINE:STARt", unit_deg, LINE_START),
    VALUE("SCAN:LINE:STOP", unit_deg, LINE_STOP),
    VALUE("SCAN:PAN:STARt", unit_deg, PAN_START),
    VALUE("SCAN:PAN:STOP", unit_deg, PAN_STOP),
    VALUE("SCAN:FRAMes", unit_count, FRAMES),
    VALUE("SCAN:ECHoes", unit_count, ECHOES),
    VALUE("SCAN:WAVeform", unit_count, WAVES),
    CHANGE("SCAN:STARt", act_start, HEAD_EV_START),
    CHANGE("SCAN:STOP", act_stop, HEAD_EV_STOP),
    QUERY("SCAN:COUNt", query_count),
    {"SCAN:REPLay", command_replay_query, command_replay_change, &unit_replay, NULL, 0, 0, 1, 0, 0},
    {"SITE:POSE", command_place_query, command_place_change, &unit_place, NULL, 0, 0, 1, 0,
     HEAD_EV_START + 1},
    {"FAULt:ADD", NULL, command_fault_add, &unit_fault, NULL, 0, 0, 1, 0, 0},
    {"FAULt:CLEar", NULL, command_fault_clear, &unit_fault, NULL, 0, 0, 1, 0, 0},
    {"FAULt:INJected", command_fault_injected, NULL, NULL, NULL, 0, 0, 1, 0, 0},
    QUERY("FAULt:LIST", command_fault_list),
    {"HELP", command_help, NULL, NULL, NULL, 0, 0, 0, 1, 0},
    QUERY("HELP:SETtings", command_help_settings),
    QUERY("TIME", query_time),
    QUERY("TIME:UTC", query_utc),
    QUERY("TIME:GPS", query_gps),
    QUERY("TIME:PTP", query_ptp),
    {"TIME:STEP", NULL, act_step, &unit_ns, NULL, 0, 1, 0, 0, 0},
    /* Open to sessions without control, as HEAD:REBoot is. */
    {"TIME:SHIFt", command_shift_query, command_shift_change, &unit_ns, NULL, 1, 0, 0, 0, 0},
    {"TIME:SERVer", command_server_query, command_server_change, &unit_server, NULL, 1, 0, 1, 0, 0},
    {.header = NULL},
};
/* clang-format on */
