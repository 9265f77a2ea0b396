/* SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/scip_session.h"

/* The command table, and the commands that are neither information nor measurement. */

int32_t scip_number(const char *text, size_t len)
{
    int32_t value = 0;
    for (size_t i = 0; i < len; i++) {
        if (text[i] < '0' || text[i] > '9') return -1;
        value = value * 10 + (text[i] - '0');
    }
    return value;
}

static const char *switch_laser_on(struct scip *s)
{
    if (s->simulation.broken) return "01";
    if (s->laser) return "02";
    if (s->time_mode) return "10";
    const char *refused = scip_laser_on(s);
    if (refused == NULL) return "00";
    return strcmp(refused, "50") == 0 ? "01" : refused;
}

static const char *quit(struct scip *s)
{
    scip_laser_off(s);
    s->time_mode = s->asleep = 0;
    return "00";
}

/* The speed is the sensor's: another session, which is over by now, may have changed it. 0, or the error of the head,
 * which another session may control. */
static int reset_speed(struct scip *s)
{
    if ((s->features & SCIP_MOTOR_SPEED) == 0 ||
        scip_lines_uhz(s, "HEAD:LINES?") == scip_lines_uhz(s, "HEAD:LINES? DEF"))
        return 0;
    return s->spec.host.command(s->spec.host.ctx, "HEAD:LINES DEF", NULL, 0);
}

/* RT: RS without the timer and the bit rate. */
static const char *reset(struct scip *s)
{
    if (reset_speed(s) != 0) return "10";
    quit(s);
    s->simulation = (struct scip_simulation){0};
    if (s->line[1] == 'S') {
        s->epoch_ns = s->epoch_us_ns = s->now_ns;
        s->bit_rate = s->model->bit_rate;
    }
    return "00";
}

static const char *ask_reboot(struct scip *s)
{
    enum { SECOND_NS = 1000000000 };
    const int again = s->rb_ns != INT64_MIN && s->now_ns - s->rb_ns <= SECOND_NS;
    s->rb_ns = again ? INT64_MIN : s->now_ns;
    if (again) {
        scip_laser_off(s);
        s->reboot_ns = s->now_ns + SECOND_NS;
        return "00";
    }
    scip_reply_begin(&s->reply, s->line, s->n_line, "01"); /* the first of two is not counted as wrong */
    scip_send(s);
    return NULL;
}

static const char *time_mode(struct scip *s, char code)
{
    if (code == '0' && scip_boots(protocol_ask_state(&s->spec.host))) return "10";
    if (code == '0' && s->time_mode) return "02";
    if (code == '0' && (s->stream.active || s->single.active)) return "10";
    if (code == '2' && !s->time_mode) return "03";
    if (code == '1' && !s->time_mode && (s->features & SCIP_TIME_ALONE) != 0) return "04";
    return code < '0' || code > '2' ? "01" : "00";
}

static const char *adjust_time(struct scip *s)
{
    const char code = s->line[2];
    const char *status = time_mode(s, code);
    if (strcmp(status, "00") != 0) return status;
    if (code == '0') scip_laser_off(s);
    if (code != '1') s->time_mode = code == '0';
    if (code != '1') return status;
    scip_reply_begin(&s->reply, s->line, s->n_line, status);
    scip_reply_time(&s->reply, scip_time_ms(s, s->now_ns));
    scip_send(s);
    return NULL;
}

/* %TM takes only the code 1. The codes 0 and 2 switch the time mode, which only TM does. */
static const char *tell_time_us(struct scip *s)
{
    if (s->line[3] != '1') return "01";
    scip_reply_begin(&s->reply, s->line, s->n_line, "00");
    scip_reply_time_us(&s->reply, scip_time_us(s, s->now_ns));
    scip_send(s);
    return NULL;
}

static const char *bit_rate(struct scip *s)
{
    static const int32_t rates[] = {19200, 38400, 57600, 115200, 250000, 500000, 750000};
    const int32_t rate = scip_number(s->line + 2, 6);
    size_t i = 0;
    if ((s->features & SCIP_BIT_RATE) == 0) return "0F";
    if (rate < 0) return "01";
    while (i < sizeof rates / sizeof *rates && rate != rates[i])
        i++;
    if (i == sizeof rates / sizeof *rates) return "02";
    if ((uint32_t)rate == s->bit_rate) return "03";
    s->bit_rate = (uint32_t)rate;
    return "00";
}

/* Level 1 to 10: 1 to 10 percent slower. 0 and 99: the default. */
static const char *motor_speed(struct scip *s)
{
    char command[48];
    const int32_t level = scip_number(s->line + 2, 2);
    if ((s->features & SCIP_MOTOR_SPEED) == 0) return "04";
    if (level < 0) return "01";
    if (level > 10 && level != 99) return "02";
    const uint64_t now_uhz = scip_lines_uhz(s, "HEAD:LINES?"), normal_uhz = scip_lines_uhz(s, "HEAD:LINES? DEF");
    const uint64_t wanted_uhz = normal_uhz * (level == 99 ? 100u : 100u - (uint32_t)level) / 100;
    if (wanted_uhz == now_uhz) return "03";
    snprintf(command, sizeof command, "HEAD:LINES %llu.%06llu", (unsigned long long)(wanted_uhz / 1000000),
             (unsigned long long)(wanted_uhz % 1000000));
    const int error = s->spec.host.command(s->spec.host.ctx, command, NULL, 0);
    if (error != 0) return error == -222 || error == -221 ? "04" : "10";
    return "00";
}

static const char *sensitivity(struct scip *s)
{
    return s->line[2] == '0' || s->line[2] == '1' ? "03" : "01";
}

static const char *fall_asleep(struct scip *s)
{
    scip_laser_off(s);
    s->asleep = 1;
    return "00";
}

static const struct command {
    char name[4];
    uint8_t n_params;  /* characters after the name */
    uint32_t features; /* a model that lacks one of them lacks the command */
    scip_handler *carry_out;
} commands[] = {
    {"VV", 0, 0, scip_info_version},
    {"PP", 0, 0, scip_info_parameters},
    {"II", 0, 0, scip_info_state},
    {"BM", 0, 0, switch_laser_on},
    {"QT", 0, 0, quit},
    {"RS", 0, 0, reset},
    {"RT", 0, SCIP_REBOOT, reset},
    {"RB", 0, SCIP_REBOOT, ask_reboot},
    {"TM", 1, 0, adjust_time},
    {"SS", 6, 0, bit_rate},
    {"CR", 2, 0, motor_speed},
    {"HS", 1, 0, sensitivity},
    {"DB", 2, 0, scip_simulate},
    {"%SL", 0, SCIP_SLEEP, fall_asleep},
    {"%ST", 0, SCIP_STATE, scip_info_state_number},
    {"%TM", 1, SCIP_TIME_US, tell_time_us},
    {"GD", 10, 0, scip_measure},
    {"GS", 10, 0, scip_measure},
    {"GE", 10, SCIP_INTENSITY, scip_measure},
    {"HD", 10, SCIP_MULTI_ECHO, scip_measure},
    {"HE", 10, SCIP_MULTI_ECHO | SCIP_INTENSITY, scip_measure},
    {"MD", 13, 0, scip_measure},
    {"MS", 13, 0, scip_measure},
    {"ME", 13, SCIP_INTENSITY, scip_measure},
    {"%MD", 13, SCIP_TIME_US, scip_measure},
    {"%ME", 13, SCIP_TIME_US | SCIP_INTENSITY, scip_measure},
    {"ND", 13, SCIP_MULTI_ECHO, scip_measure},
    {"NE", 13, SCIP_MULTI_ECHO | SCIP_INTENSITY, scip_measure},
};

static const struct command *scip_command_find(const struct scip *s, size_t len)
{
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        const struct command *c = &commands[i];
        const size_t n = strlen(c->name);
        if (len >= n && memcmp(s->line, c->name, n) == 0 && (s->features & c->features) == c->features) return c;
    }
    return NULL;
}

static const char *check_tag(const char *tag, size_t len)
{
    enum { MOST = 16 };
    if (len > MOST) return "0G";
    for (size_t i = 0; i < len; i++) {
        const char c = tag[i];
        const int letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
        if (!letter && strchr(" ._+@", c) == NULL) return "0H";
    }
    return NULL;
}

/* Checks name, tag and length of the line. n: its length without the tag and the ';' before it. NULL, or the status. */
static const char *check_line(const struct scip *s, const struct command *c, size_t n)
{
    const int time_alone = s->time_mode && (s->features & SCIP_TIME_ALONE) != 0;
    if (c == NULL || (time_alone && c->carry_out != adjust_time)) return "0E";
    const char *wrong = n < s->n_line ? check_tag(s->line + n + 1, s->n_line - n - 1) : NULL;
    if (wrong != NULL) return wrong;
    const size_t wanted = strlen(c->name) + c->n_params;
    if (n == wanted) return NULL;
    return n < wanted ? "0C" : "0D";
}

void scip_command(struct scip *s)
{
    const char *tag = memchr(s->line, ';', s->n_line);
    const size_t n = tag == NULL ? s->n_line : (size_t)(tag - s->line);
    const struct command *c = scip_command_find(s, n);
    const char *status = check_line(s, c, n);
    if (status == NULL) status = c->carry_out(s);
    if (status != NULL) scip_answer(s, s->line, s->n_line, status);
}
