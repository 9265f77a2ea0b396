/* The only list of commands, and what each of them does. What settings have in common is in setting.c. */
#include "firmware_sim/command/command_inside.h"

#include <stdio.h>
#include <string.h>

/* clang-format off */
#define SETTING(field) offsetof(struct head_settings, field)
#define PROFILE(field) {1, (int64_t)offsetof(struct head_limits, field)}
#define CONSTANT(n)    {0, (n)}
#define NO_OTHER       NULL, 0, 0, 0, 0

enum { TURN_UDEG = 360000000 };

static const struct command_unit unit_hz = {"Hz", 6, "HZ, KHZ or MHZ", {{"HZ", 0}, {"KHZ", 3}, {"MHZ", 6}}};
static const struct command_unit unit_deg = {"deg", 6, "DEG", {{"DEG", 0}}};
static const struct command_unit unit_deg_s = {"deg/s", 6, "DEG/S", {{"DEG/S", 0}}};
static const struct command_unit unit_ns = {"ns", 0, "NS, US, MS or S", {{"NS", 0}, {"US", 3}, {"MS", 6}, {"S", 9}}};
static const struct command_unit unit_count = {"", 0, "no unit", {{NULL, 0}}};

enum { PRR, LINES, PAN, STATION, LINE_START, LINE_STOP, PAN_START, PAN_STOP, FRAMES, ECHOES };

/* In the order of enum beam_select. */
static const char *const echo_words[] = {"ALL", "FIRSt", "LAST", "STRongest", NULL};

/* A pulse rate below the line rate would leave lines without a pulse. A line or a pan sweep without width has
 * nothing to scan. A pan sweep beyond a turn would scan things twice. */
static const struct command_setting settings[] = {
    /* field, is_u32, not_in_scan, min, max, other, its field, least, most, is_rate, words */
    [PRR] = {SETTING(prr_uhz), 0, 0, PROFILE(prr_min_uhz), PROFILE(prr_max_uhz),
             "HEAD:LINes", SETTING(lines_uhz), 0, COMMAND_UNBOUND, 1, NULL},
    [LINES] = {SETTING(lines_uhz), 0, 0, PROFILE(lines_min_uhz), PROFILE(lines_max_uhz),
               "HEAD:PRR", SETTING(prr_uhz), COMMAND_UNBOUND, 0, 0, NULL},
    [PAN] = {SETTING(pan_udeg_s), 0, 0, CONSTANT(0), PROFILE(pan_max_udeg_s), NO_OTHER, NULL},
    [STATION] = {SETTING(station), 1, 1, CONSTANT(1), PROFILE(n_stations), NO_OTHER, NULL},
    [LINE_START] = {SETTING(line_start_udeg), 0, 0, PROFILE(fov_min_udeg), PROFILE(fov_max_udeg),
                    "SCAN:LINE:STOP", SETTING(line_stop_udeg), COMMAND_UNBOUND, -1, 0, NULL},
    [LINE_STOP] = {SETTING(line_stop_udeg), 0, 0, PROFILE(fov_min_udeg), PROFILE(fov_max_udeg),
                   "SCAN:LINE:STARt", SETTING(line_start_udeg), 1, COMMAND_UNBOUND, 0, NULL},
    [PAN_START] = {SETTING(pan_start_udeg), 0, 0, PROFILE(pan_min_udeg), PROFILE(pan_max_udeg),
                   "SCAN:PAN:STOP", SETTING(pan_stop_udeg), -TURN_UDEG, -1, 0, NULL},
    [PAN_STOP] = {SETTING(pan_stop_udeg), 0, 0, PROFILE(pan_min_udeg), PROFILE(pan_max_udeg),
                  "SCAN:PAN:STARt", SETTING(pan_start_udeg), 1, TURN_UDEG, 0, NULL},
    [FRAMES] = {SETTING(frames), 1, 0, CONSTANT(0), CONSTANT(HEAD_MAX_FRAMES), NO_OTHER, NULL},
    [ECHOES] = {SETTING(echoes), 1, 0, CONSTANT(0), CONSTANT(3), NO_OTHER, echo_words},
};
/* clang-format on */

static int query_idn(struct command_call *call)
{
    return command_reply(call, "%s", call->dev->idn);
}

static int query_opc(struct command_call *call)
{
    return command_reply(call, "1"); /* no command is still at work once its reply is out */
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

static int query_version(struct command_call *call)
{
    return command_reply(call, "1999.0");
}

static int query_control(struct command_call *call)
{
    return command_reply(call, "%u", call->dev->control);
}

static int query_state(struct command_call *call)
{
    return command_reply(call, "%s", head_state_name(call->dev->state));
}

static int query_count(struct command_call *call)
{
    return command_reply(call, "%llu", (unsigned long long)call->dev->frames_done);
}

static int query_time(struct command_call *call)
{
    return command_reply(call, "%lld", (long long)call->dev->t_ns);
}

/* An empty text: the head does not know the time. */
static int reply_time_of_day(struct command_call *call, const char *text)
{
    if (text[0] == '\0')
        return command_fail(call, CMD_E_SETTINGS, "%s? needs time.epoch in the configuration", call->row->header);
    return command_reply(call, "%s", text);
}

static int query_utc(struct command_call *call)
{
    return reply_time_of_day(call, call->dev->utc);
}

static int query_gps(struct command_call *call)
{
    return reply_time_of_day(call, call->dev->gps);
}

static int query_help(struct command_call *call)
{
    size_t len = 0;
    for (const struct command_row *row = command_rows; row->header != NULL && len < sizeof call->out->reply; row++)
        len += (size_t)snprintf(call->out->reply + len, sizeof call->out->reply - len, "%s%s%s", len == 0 ? "" : " ",
                                row->header,
                                row->query == NULL ? ""
                                : row->act == NULL ? "?"
                                                   : "[?]");
    return 0;
}

static int act_clear(struct command_call *call)
{
    memset(&call->dev->queue, 0, sizeof call->dev->queue);
    return command_reply(call, "OK");
}

static int act_release(struct command_call *call)
{
    if (call->dev->control != 0) call->out->effect = COMMAND_RELEASE;
    call->dev->control = 0;
    return command_reply(call, "OK");
}

/* The effect, or -221 where the state machine refuses the event. */
static int act_event(struct command_call *call, enum head_event event, enum command_effect effect)
{
    if (head_next_state(call->dev->state, event) < 0)
        return command_fail(call, CMD_E_SETTINGS, "%s is not possible in state %s", call->row->header,
                            head_state_name(call->dev->state));
    call->out->effect = effect;
    return command_reply(call, "OK");
}

static int act_start(struct command_call *call)
{
    return act_event(call, HEAD_EV_START, COMMAND_START);
}

static int act_stop(struct command_call *call)
{
    return act_event(call, HEAD_EV_STOP, COMMAND_STOP);
}

static int act_reset(struct command_call *call)
{
    if (act_event(call, HEAD_EV_RESET, COMMAND_RESET) != 0) return -1;
    call->dev->settings = call->dev->defaults;
    return 0;
}

static int act_step(struct command_call *call)
{
    int64_t step_ns;
    const int64_t day_ns = 86400000000000; /* a grant cannot be taken back */
    if (command_value_in_range(call, 1, day_ns, &step_ns) != 0) return -1;
    if (call->pose != NULL && command_take_pose(call) != 0) return -1;
    if (!call->dev->step_allowed)
        return command_fail(call, CMD_E_SETTINGS, "%s needs the pace step", call->row->header);
    call->out->effect = COMMAND_STEP;
    call->out->step_ns = step_ns;
    return command_reply(call, "OK");
}

/* clang-format off */
#define QUERY(header, query)       {header, query, NULL, NULL, NULL, 0, 0}
#define ACTION(header, act, open)  {header, NULL, act, NULL, NULL, open, 0}
#define VALUE(header, unit, which) \
    {header, command_setting_query, command_setting_change, &(unit), &settings[which], 0, 0}

const struct command_row command_rows[] = {
    QUERY("*IDN", query_idn),
    ACTION("*RST", act_reset, 0),
    ACTION("*CLS", act_clear, 1), /* open, as SYSTem:ERRor? empties the queue too */
    QUERY("*OPC", query_opc),
    QUERY("*STB", query_stb),
    QUERY("SYSTem:ERRor[:NEXT]", query_error),
    QUERY("SYSTem:ERRor:COUNt", query_error_count),
    QUERY("SYSTem:VERSion", query_version),
    QUERY("SYSTem:CONTrol", query_control),
    QUERY("SYSTem:PLAN", query_plan),
    ACTION("SYSTem:CONTrol:RELease", act_release, 0),
    VALUE("HEAD:PRR", unit_hz, PRR),
    VALUE("HEAD:LINes", unit_hz, LINES),
    VALUE("HEAD:PAN", unit_deg_s, PAN),
    QUERY("HEAD:STATe", query_state),
    VALUE("HEAD:STATION", unit_count, STATION), /* no short form: STAT is STATe */
    VALUE("SCAN:LINE:STARt", unit_deg, LINE_START),
    VALUE("SCAN:LINE:STOP", unit_deg, LINE_STOP),
    VALUE("SCAN:PAN:STARt", unit_deg, PAN_START),
    VALUE("SCAN:PAN:STOP", unit_deg, PAN_STOP),
    VALUE("SCAN:FRAMes", unit_count, FRAMES),
    VALUE("SCAN:ECHoes", unit_count, ECHOES),
    ACTION("SCAN:STARt", act_start, 0),
    ACTION("SCAN:STOP", act_stop, 0),
    QUERY("SCAN:COUNt", query_count),
    QUERY("HELP", query_help),
    QUERY("TIME", query_time),
    QUERY("TIME:UTC", query_utc),
    QUERY("TIME:GPS", query_gps),
    {"TIME:STEP", NULL, act_step, &unit_ns, NULL, 0, 1},
    {.header = NULL},
};
/* clang-format on */
