/* SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>

#include "drivers/host/scanhead.h"
#include "firmware_sim/app/studio/soak/ask.h"
#include "firmware_sim/app/studio/soak/head.h"
#include "firmware_sim/app/studio/soak/link.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/fault/fault.h"

/* On a busy machine a reply may take seconds, since a terminal first carries the frames that were sent before it. */
enum { REPLY_MS = 5000, REPLY_LEN = SOAK_REPLY_LEN };
static const double MARGIN_MS = 5.0;
static const int64_t AFTER_END_NS = 1000000000;
/* The library resynchronises with questions of its own. The library repeats a question that has no answer after a
 * second. */
static const double ASKED_AGAIN_MS = 900.0;

static int is_count(const char *text)
{
    return text[0] != '\0' && strlen(text) <= 2 && strspn(text, "0123456789") == strlen(text);
}

static int is_state(const char *text)
{
    for (int state = 0; state < HEAD_N_STATES; state++)
        if (strcmp(text, head_state_name((enum head_state)state)) == 0) return 1;
    return 0;
}

static int is_start(const char *text)
{
    return strcmp(text, "OK") == 0 || strncmp(text, "ERR -203", 8) == 0 || strncmp(text, "ERR -221", 8) == 0;
}

/* The last of the four fields names the stream. A list of four, as of FAULt:LIST?, is no identity. */
static int is_identity(const char *text)
{
    static const char last[] = "scanhead native ";
    const char *field = text;
    int commas = 0;
    for (const char *at = text; *at != '\0'; at++)
        if (*at == ',') {
            commas++;
            field = at + 1;
        }
    return commas == 3 && strncmp(field, last, sizeof last - 1) == 0;
}

static int is_version(const char *text)
{
    return strcmp(text, "1999.0") == 0;
}

/* ---- one question */

struct answer {
    int rc, is_right;
    int is_same;      /* as the reply before */
    int is_after_end; /* it was asked just after a session ended */
    double ms;
};

static int is_noticed(const struct soak_ask *ask, const struct fault_note *note, const struct answer *a)
{
    switch (note->kind) {
    case FAULT_NO_REPLY:
        return a->rc == SCANHEAD_ETIMEOUT || a->ms >= ASKED_AGAIN_MS;
    case FAULT_LATE_REPLY:
        return a->rc == SCANHEAD_ETIMEOUT || a->ms >= note->for_ms - MARGIN_MS;
    case FAULT_WRONG_REPLY:
        return a->rc == SCANHEAD_ETIMEOUT || !a->is_right;
    default: /* FAULT_ECHO: an echo that lacks its CR counts as bad bytes */
        return ask->echoes != 0 || ask->bad_bytes >= note->n;
    }
}

static void judge_note(struct soak_link *link, const struct fault_note *note, const struct answer *a)
{
    const struct soak_ask *ask = &link->ask;
    struct soak_row *row = &link->row[note->kind];
    if (is_noticed(ask, note, a))
        row->noticed++;
    else if (a->rc != SCANHEAD_OK && a->rc != SCANHEAD_ETIMEOUT)
        soak_hide(row, 1, "the session was over before it");
    else if (note->kind == FAULT_WRONG_REPLY && a->is_same)
        soak_hide(row, 1, "the reply before was the same");
    else if (ask->settling)
        soak_hide(row, 1, "it hit a question by which the library resynchronises");
    else
        row->missed++;
}

/* An answer is odd where no fault explains it. A reply that comes next to damaged bytes is lost with them. The reply to
 * a question that is sent just after a session ended may be lost with the old connection. */
static void ask_judge(struct soak_link *link, const struct answer *a)
{
    struct soak_ask *ask = &link->ask;
    ask->answered += a->rc == SCANHEAD_OK && a->is_right;
    ask->timeouts += a->rc == SCANHEAD_ETIMEOUT;
    ask->wrong += a->rc == SCANHEAD_OK && !a->is_right;
    for (uint32_t i = 0; i < ask->n; i++)
        judge_note(link, &ask->note[i], a);
    if (ask->bad_bytes != 0) link->expected_bad_max += REPLY_LEN;
    if (ask->n == 0 && (a->rc == SCANHEAD_ETIMEOUT || (a->rc == SCANHEAD_OK && !a->is_right))) {
        const int is_hurt = ask->others != 0 || a->is_after_end;
        ask->hurt += (uint64_t)is_hurt;
        ask->odd += (uint64_t)!is_hurt;
    }
}

static int ask_put(struct soak_link *link, const char *command, int (*is_right)(const char *text),
                   char reply[REPLY_LEN])
{
    struct soak_ask *ask = &link->ask;
    struct answer a;
    pthread_mutex_lock(&link->lock);
    ask->active = 1;
    ask->n = ask->echoes = 0;
    ask->others = ask->bad_bytes = 0;
    ask->asked++;
    const int64_t from_ns = clock_now_ns();
    a.is_after_end = ask->ended_ns != 0 && from_ns - ask->ended_ns < AFTER_END_NS;
    pthread_mutex_unlock(&link->lock);
    a.rc = scanhead_command(link->sh, command, reply, REPLY_LEN, REPLY_MS);
    a.ms = 1e-6 * (double)(clock_now_ns() - from_ns);
    a.is_right = a.rc == SCANHEAD_OK && is_right(reply);
    a.is_same = a.rc == SCANHEAD_OK && strcmp(reply, ask->before) == 0;
    if (a.rc == SCANHEAD_OK) memcpy(ask->before, reply, sizeof ask->before);
    pthread_mutex_lock(&link->lock);
    ask_judge(link, &a);
    ask->active = 0;
    ask->settling = a.rc == SCANHEAD_ETIMEOUT;
    pthread_mutex_unlock(&link->lock);
    return a.is_right;
}

/* ---- what is asked */

void soak_ask_next(struct soak_link *link)
{
    static const struct {
        const char *command;
        int (*is_right)(const char *text);
    } questions[] = {{"*IDN?", is_identity}, {"SYST:ERR:COUN?", is_count}, {"SYST:VERS?", is_version}};
    const uint32_t which = link->ask.next++ % (sizeof questions / sizeof *questions);
    char reply[REPLY_LEN] = "";
    const int is_right = ask_put(link, questions[which].command, questions[which].is_right, reply);
    if (which == 0 && is_right) snprintf(link->idn, sizeof link->idn, "%.255s", reply);
}

void soak_ask_scan(struct soak_link *link)
{
    char reply[REPLY_LEN] = "";
    if (!ask_put(link, "HEAD:STATe?", is_state, reply)) return;
    soak_saw_state(link, reply);
    if (strcmp(reply, "idle") == 0) ask_put(link, "SCAN:STARt", is_start, reply);
    if (strcmp(reply, "fault") == 0) ask_put(link, "*RST", is_start, reply);
}
