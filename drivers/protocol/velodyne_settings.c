/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/velodyne_settings.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "drivers/protocol/http_request.h"
#include "drivers/protocol/velodyne.h"

struct posted {
    const struct protocol_spec *spec;
    char *text;      /* of an error */
    int apply;       /* 0: the form is only checked */
    const char *key; /* whose value is at hand */
};

static int refuse(const struct posted *p, int status, const char *why)
{
    snprintf(p->text, VELODYNE_TEXT, "%s", why);
    return status;
}

/* 200, or the status for what the head refuses: another session has control, out of range, not now. While the form is
 * checked nothing is done. */
static int command(const struct posted *p, const char *line)
{
    char reply[PROTOCOL_REPLY];
    const struct protocol_host *host = &p->spec->host;
    const int error = p->apply ? host->command(host->ctx, line, reply, sizeof reply) : 0;
    if (error == 0) return 200;
    snprintf(p->text, VELODYNE_TEXT, "the head refuses %s: %s", line, reply);
    return error == -203 ? 409 : error == -222 ? 400 : 503;
}

static void ask(const struct protocol_spec *spec, const char *line, char *reply, size_t cap)
{
    char whole[PROTOCOL_REPLY];
    if (spec->host.command(spec->host.ctx, line, whole, sizeof whole) != 0) whole[0] = '\0';
    snprintf(reply, cap, "%.*s", (int)cap - 1, whole);
}

/* Reads a whole number of at most nine digits. Returns 1, or 0 if it is none. */
static int read_number(const char *s, long *out)
{
    const size_t len = strlen(s);
    if (len == 0 || len > 9 || strspn(s, "0123456789") != len) return 0;
    *out = strtol(s, NULL, 10);
    return 1;
}

static int read_switch(const char *s, int *on)
{
    *on = strcasecmp(s, "on") == 0;
    return *on || strcasecmp(s, "off") == 0;
}

/* ---- the keys. Each is called first to check its value, then to carry it out, and returns 200 or an error. */

static int is_scanning(const struct protocol_spec *spec)
{
    const enum protocol_head_state state = protocol_ask_state(&spec->host);
    return state == PROTOCOL_HEAD_SCANNING || state == PROTOCOL_HEAD_SPIN_UP;
}

/* Starts the scan unless it runs. A head that can't start now is found while the form is checked, so that nothing of
 * the form is done. */
static int start(const struct posted *p)
{
    const enum protocol_head_state state = protocol_ask_state(&p->spec->host);
    if (state == PROTOCOL_HEAD_SCANNING || state == PROTOCOL_HEAD_SPIN_UP) return 200;
    if (state == PROTOCOL_HEAD_IDLE || state == PROTOCOL_HEAD_UNKNOWN) return command(p, "SCAN:START");
    /* While the form is carried out, the head may have failed, or another client may have stopped it, just now. */
    return refuse(p, 503,
                  p->apply ? "the head can't start now: it boots, spins down or has failed"
                           : "the head can't start now: it boots, spins down or has failed; nothing has changed");
}

static int set_laser(const struct posted *p, const char *value)
{
    int on;
    if (!read_switch(value, &on)) return refuse(p, 400, "laser: allowed are on and off");
    if (on) return start(p);
    return is_scanning(p->spec) ? command(p, "SCAN:STOP") : 200;
}

static const struct {
    const char *name, *word; /* of the device, of SCAN:ECHOES */
} returns[] = {{"Strongest", "STRONGEST"}, {"Last", "LAST"}, {"Dual", "ALL"}};

static int set_returns(const struct posted *p, const char *value)
{
    for (size_t i = 0; i < sizeof returns / sizeof returns[0]; i++) {
        char line[32];
        if (strcasecmp(value, returns[i].name) != 0) continue;
        snprintf(line, sizeof line, "SCAN:ECHOES %s", returns[i].word);
        return command(p, line);
    }
    return refuse(p, 400, "returns: allowed are Strongest, Last and Dual");
}

/* The head takes turns per second in steps of 1e-6 Hz. A speed that 3 does not divide is rounded to that step. */
static int set_rpm(const struct posted *p, const char *value)
{
    char line[40];
    long rpm;
    if (!read_number(value, &rpm) || (rpm != 0 && (rpm < 300 || rpm > 1200)))
        return refuse(p, 400, "rpm: allowed are whole numbers from 300 to 1200, and 0: the motor stops");
    if (rpm == 0) return is_scanning(p->spec) ? command(p, "SCAN:STOP") : 200;
    const long uhz = (rpm * 1000000 + 30) / 60;
    snprintf(line, sizeof line, "HEAD:LINES %ld.%06ld", uhz / 1000000, uhz % 1000000);
    return command(p, line);
}

static int set_fov(const struct posted *p, const char *value)
{
    const long whole = strcmp(p->key, "end") == 0 ? 359 : 0;
    long deg;
    if (!read_number(value, &deg) || deg > 359)
        return refuse(p, 400, "start, end: allowed are whole numbers from 0 to 359 degrees");
    if (deg == whole) return 200;
    snprintf(p->text, VELODYNE_TEXT, "%s: allowed is %ld; this head sends the whole turn", p->key, whole);
    return 409;
}

static int set_address(const struct posted *p, const char *value)
{
    if (strcmp(value, velodyne_host_address(p->spec)) == 0) return 200;
    return refuse(p, 409, "addr: can't be changed here; the head's configuration sets it (links)");
}

static int set_port(const struct posted *p, const char *value)
{
    const long present = strcmp(p->key, "dport") == 0 ? velodyne_host_port(p->spec) : velodyne_position_port(p->spec);
    long port;
    if (!read_number(value, &port) || port < 1 || port > 65535)
        return refuse(p, 400, "dport, tport: allowed are 1 to 65535");
    if (port == present) return 200;
    return refuse(p, 409, "dport, tport: can't be changed here; the head's configuration sets them (links)");
}

static int set_network(const struct posted *p, const char *value)
{
    (void)value;
    return refuse(p, 409, "the head's own address can't be changed here; its configuration sets it (links)");
}

static int set_phase_lock(const struct posted *p, const char *value)
{
    int on;
    if (!read_switch(value, &on)) return refuse(p, 400, "enabled: allowed are on and off");
    return command(p, on ? "HEAD:PHASE:LOCK ON" : "HEAD:PHASE:LOCK OFF");
}

/* Reads a decimal number from 0 to below the limit, which is half a step above the largest that is allowed. Returns 1,
 * or 0 if it is none. */
static int read_decimal(const char *s, double limit, double *out)
{
    char *end;
    if (s[0] < '0' || s[0] > '9' || strspn(s, "0123456789.") != strlen(s)) return 0;
    *out = strtod(s, &end);
    return *end == '\0' && *out < limit;
}

/* The device's page sends `offset`, which is 100 times its field offsetInput, and offsetInput itself. The product may
 * have many decimals. */
static int set_phase(const struct posted *p, const char *value)
{
    char line[40];
    double cdeg;
    if (!read_decimal(value, 35999.5, &cdeg)) return refuse(p, 400, "offset: allowed are 0 to 35999, in 0.01 degree");
    const long whole = (long)(cdeg + 0.5);
    snprintf(line, sizeof line, "HEAD:PHASE %ld.%02ld", whole / 100, whole % 100);
    return command(p, line);
}

/* offsetInput has no effect, but a value that the device doesn't take is refused. */
static int check_phase_input(const struct posted *p, const char *value)
{
    double deg;
    return read_decimal(value, 359.995, &deg) ? 200
                                              : refuse(p, 400, "offsetInput: allowed are 0 to 359.99, in degrees");
}

/* A head without a settings file stores nothing, but answers 200: clients expect that a device takes this form. */
static int save(const struct posted *p, const char *value)
{
    if (strcasecmp(value, "submit") != 0) return refuse(p, 400, "data: allowed is submit");
    return p->spec->keeps ? command(p, "HEAD:STORE") : 200;
}

/* Sets what power-up sets, and starts the scan. The device is silent for some seconds then; this head is not. */
static int reset(const struct posted *p, const char *value)
{
    if (strcasecmp(value, "reset_system") != 0) return refuse(p, 400, "data: allowed is reset_system");
    if (!p->apply) return start(p);
    int status = command(p, "HEAD:LINES DEF");
    if (status == 200) status = command(p, "SCAN:ECHOES DEF");
    if (status == 200) status = command(p, "HEAD:PHASE DEF");
    if (status == 200) status = command(p, "HEAD:PHASE:LOCK DEF");
    return status == 200 ? start(p) : status;
}

static const struct setting {
    const char *path, *key;
    int (*set)(const struct posted *p, const char *value);
} settings[] = {
    {"/cgi/setting", "laser", set_laser},
    {"/cgi/setting", "returns", set_returns},
    {"/cgi/setting", "rpm", set_rpm},
    {"/cgi/setting/fov", "start", set_fov},
    {"/cgi/setting/fov", "end", set_fov},
    {"/cgi/setting/host", "addr", set_address},
    {"/cgi/setting/host", "dport", set_port},
    {"/cgi/setting/host", "tport", set_port},
    {"/cgi/setting/net", "addr", set_network},
    {"/cgi/setting/net", "mask", set_network},
    {"/cgi/setting/net", "gateway", set_network},
    {"/cgi/setting/net", "dhcp", set_network},
    {"/cgi/setting/phaselock", "enabled", set_phase_lock},
    {"/cgi/setting/phaselock", "offset", set_phase},
    {"/cgi/setting/phaselock", "offsetInput", check_phase_input},
    {"/cgi/save", "data", save},
    {"/cgi/reset", "data", reset},
};
enum { N_SETTINGS = sizeof settings / sizeof settings[0] };

int velodyne_takes_forms(const char *path)
{
    for (int i = 0; i < N_SETTINGS; i++)
        if (strcmp(settings[i].path, path) == 0) return 1;
    return 0;
}

/* ---- forms: key=value&key=value, with + and %41 */

/* Decodes in place, and puts a NUL after the text, for which there is room. 0, or -1: not a form's text. */
static int decode(char *s, size_t len)
{
    char *to = s;
    for (size_t i = 0; i < len; i++, to++) {
        *to = s[i] == '+' ? ' ' : s[i];
        if (s[i] == '%') {
            if (i + 2 >= len || http_hex_digit(s[i + 1]) < 0 || http_hex_digit(s[i + 2]) < 0) return -1;
            *to = (char)(http_hex_digit(s[i + 1]) << 4 | http_hex_digit(s[i + 2]));
            i += 2;
        }
        if ((unsigned char)*to < 32) return -1;
    }
    *to = '\0';
    return 0;
}

struct pair {
    const struct setting *setting;
    const char *value;
};

static const struct setting *find_setting(const char *path, const char *key)
{
    for (int i = 0; i < N_SETTINGS; i++)
        if (strcmp(settings[i].path, path) == 0 && strcmp(settings[i].key, key) == 0) return &settings[i];
    return NULL;
}

/* Reads one key=value of len characters, with room for a NUL after it. */
static int read_pair(const struct posted *p, const char *path, char *s, size_t len, struct pair *out)
{
    char *equals = memchr(s, '=', len);
    if (equals == NULL || decode(equals + 1, (size_t)(s + len - equals - 1)) != 0 ||
        decode(s, (size_t)(equals - s)) != 0)
        return refuse(p, 400, "the body is not a form: key=value&key=value");
    *out = (struct pair){find_setting(path, s), equals + 1};
    return out->setting != NULL ? 200 : refuse(p, 400, "this path has no such key");
}

/* The number of pairs, or an error as a status below 0. pairs has a place more than there are settings. */
static int read_form(const struct posted *p, const char *path, char *form, size_t len, struct pair *pairs)
{
    int n = 0;
    for (size_t at = 0, end; at < len; at = end + 1) {
        const char *ampersand = memchr(form + at, '&', len - at);
        end = ampersand != NULL ? (size_t)(ampersand - form) : len;
        int status = read_pair(p, path, form + at, end - at, &pairs[n]);
        if (status != 200) return -status;
        for (int i = 0; i < n; i++)
            if (pairs[i].setting == pairs[n].setting) return -refuse(p, 400, "a key is given twice");
        n++;
    }
    return n != 0 ? n : -refuse(p, 400, "the body is not a form: key=value&key=value");
}

/* The paths that have one meaning. Clients post nothing, the word, or the word as the value of `data` or of itself. */
static const struct {
    const char *path, *word;
} actions[] = {{"/cgi/save", "submit"}, {"/cgi/reset", "reset_system"}};

/* Writes such a form as data=word, which takes at most HTTP_MAX_BODY bytes. Returns the form's new length. */
static size_t unify(const char *path, char *form, size_t len)
{
    for (size_t i = 0; i < sizeof actions / sizeof actions[0]; i++) {
        const char *word = actions[i].word;
        const size_t n = strlen(word);
        const int is_word = len == n && strncasecmp(form, word, n) == 0;
        const int is_twice = len == 2 * n + 1 && form[n] == '=' && strncasecmp(form, word, n) == 0 &&
                             strncasecmp(form + n + 1, word, n) == 0;
        if (strcmp(actions[i].path, path) == 0 && (len == 0 || is_word || is_twice))
            return (size_t)sprintf(form, "data=%s", word);
    }
    return len;
}

/* The laser needs the motor. So no order of the two in one form has a meaning. */
static int stops_and_starts(const struct pair *pairs, int n)
{
    int stops = 0, starts = 0;
    long rpm;
    for (int i = 0; i < n; i++) {
        stops |= pairs[i].setting->set == set_rpm && read_number(pairs[i].value, &rpm) && rpm == 0;
        starts |= pairs[i].setting->set == set_laser && strcasecmp(pairs[i].value, "on") == 0;
    }
    return stops && starts;
}

int velodyne_post(const struct protocol_spec *spec, const char *path, const char *form, size_t len, char *text)
{
    struct pair pairs[N_SETTINGS + 1];
    struct posted posted = {.spec = spec, .text = text};
    char copy[HTTP_MAX_BODY + 1];
    memcpy(copy, form, len);
    const int n = read_form(&posted, path, copy, unify(path, copy, len), pairs);
    int status = n < 0 ? -n : 200;
    if (stops_and_starts(pairs, n))
        status = refuse(&posted, 400, "rpm=0 and laser=on: allowed is one of them; nothing has changed");
    for (; posted.apply < 2; posted.apply++)
        for (int i = 0; i < n && status == 200; i++) {
            posted.key = pairs[i].setting->key;
            status = pairs[i].setting->set(&posted, pairs[i].value);
        }
    return status;
}

static uint32_t read_cdeg(const char *reply)
{
    return (uint32_t)(strtod(reply, NULL) * 100.0 + 0.5) % 36000u;
}

static void read_phase(const struct protocol_spec *spec, struct velodyne_state *out)
{
    char reply[32];
    ask(spec, "HEAD:PHASE:LOCK?", reply, sizeof reply);
    out->phase_lock = strcmp(reply, "ON") == 0;
    ask(spec, "HEAD:PHASE?", reply, sizeof reply);
    out->offset_cdeg = read_cdeg(reply);
    ask(spec, "HEAD:PHASE:EDGE?", reply, sizeof reply);
    out->is_locked = strncmp(reply, "LOCKED,", 7) == 0;
    const char *comma = strchr(reply, ',');
    out->edge_cdeg = comma != NULL ? read_cdeg(comma + 1) : 0;
}

void velodyne_read_state(const struct protocol_spec *spec, struct velodyne_state *out)
{
    char reply[32];
    out->motor_on = out->laser_on = is_scanning(spec);
    ask(spec, "HEAD:LINES?", reply, sizeof reply);
    out->rpm = (uint32_t)(strtod(reply, NULL) * 60.0 + 0.5);
    ask(spec, "SCAN:ECHOES?", reply, sizeof reply);
    read_phase(spec, out);
    out->returns = "";
    for (size_t i = 0; i < sizeof returns / sizeof returns[0]; i++)
        if (strlen(reply) >= 3 && strncasecmp(reply, returns[i].word, strlen(reply)) == 0)
            out->returns = returns[i].name;
}

const char *velodyne_host_address(const struct protocol_spec *spec)
{
    return spec->address[0] != '\0' ? spec->address : "255.255.255.255";
}

int velodyne_host_port(const struct protocol_spec *spec)
{
    return spec->port != 0 ? spec->port : VELODYNE_DATA_PORT;
}

int velodyne_position_port(const struct protocol_spec *spec)
{
    return spec->position_port != 0 ? spec->position_port : VELODYNE_POSITION_PORT;
}
