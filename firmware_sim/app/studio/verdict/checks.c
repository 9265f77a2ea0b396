/* SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <sys/wait.h>

#include "firmware_sim/app/studio/verdict/checks.h"
#include "firmware_sim/fault/fault.h"

#define NAME(id, name, asks) name,
#define ASKS(id, name, asks) asks,
const char *const verdict_names[VERDICT_N_CHECKS] = {VERDICT_CHECKS(NAME)};
const char *const verdict_asks[VERDICT_N_CHECKS] = {VERDICT_CHECKS(ASKS)};

__attribute__((format(printf, 4, 5))) static void say(struct verdict *v, enum verdict_check check,
                                                      enum verdict_state state, const char *fmt, ...)
{
    struct verdict_result *r = &v->check[check];
    va_list args;
    va_start(args, fmt);
    r->state = state;
    vsnprintf(r->text, sizeof r->text, fmt, args);
    va_end(args);
}

static double s_between(int64_t from_ns, int64_t to_ns)
{
    return to_ns > from_ns ? 1e-9 * (double)(to_ns - from_ns) : 0.0;
}

/* ---- connections */

static void judge_connects(const struct checks *c, struct verdict *v)
{
    if (!c->has_sessions)
        say(v, VERDICT_CONNECTS, VERDICT_NOT_JUDGED, "the link sends to whoever is there");
    else if (c->watch->first_open_ns == 0)
        say(v, VERDICT_CONNECTS, c->was_there ? VERDICT_FOUND : VERDICT_NOT_JUDGED,
            c->was_there ? "it did not connect within %g s" : "it ended before; the limit is %g s",
            c->options->limit_s);
    else
        say(v, VERDICT_CONNECTS, VERDICT_PASSED, "after %.2f s", v->figures.connected_s);
}

struct absences {
    size_t n, missing;
    const struct watch_break *first_missing, *longest;
    double sum_s, max_s;
};

static struct absences find_absences(const struct watch *w)
{
    struct absences a = {.max_s = -1.0};
    for (size_t i = 0; i < w->n_broken; i++) {
        const struct watch_break *broken = &w->broken[i];
        if (broken->back_ns == 0) {
            if (a.missing++ == 0) a.first_missing = broken;
            continue;
        }
        const double s = s_between(broken->over_ns, broken->back_ns);
        a.n++;
        a.sum_s += s;
        if (s <= a.max_s) continue;
        a.max_s = s;
        a.longest = broken;
    }
    return a;
}

static void judge_missing(const struct checks *c, const struct absences *a, struct verdict *v)
{
    const char *kind = fault_names[a->first_missing->kind];
    const double s = s_between(a->first_missing->over_ns, c->ended_ns);
    if (!c->was_there)
        say(v, VERDICT_COMES_BACK, VERDICT_NOT_JUDGED, "it had ended");
    else if (c->holds)
        say(v, VERDICT_COMES_BACK, VERDICT_NOT_JUDGED, "it still has the connection from before %s", kind);
    else
        say(v, VERDICT_COMES_BACK, VERDICT_FOUND,
            "it did not come back after %s, for %.1f s until the end; the limit is %g s", kind, s, c->options->limit_s);
    if (c->was_there && c->holds)
        say(v, VERDICT_LETS_GO, VERDICT_FOUND, "%.1f s after %s it still had the connection from before", s, kind);
}

static void keep_absences(const struct watch *w, struct verdict *v)
{
    v->figures.breaks = w->n_broken;
    for (size_t i = 0; i < w->n_broken && i < VERDICT_MAX_BREAKS; i++) {
        const struct watch_break *b = &w->broken[i];
        v->broken[i] = (struct verdict_break){fault_names[b->kind], b->link,
                                              b->back_ns != 0 ? s_between(b->over_ns, b->back_ns) : (double)NAN};
    }
}

static void judge_absences(const struct checks *c, struct verdict *v)
{
    const struct absences a = find_absences(c->watch);
    keep_absences(c->watch, v);
    v->figures.back_mean_s = a.n > 0 ? a.sum_s / (double)a.n : (double)NAN;
    v->figures.back_max_s = a.n > 0 ? a.max_s : (double)NAN;
    say(v, VERDICT_LETS_GO, a.n > 0 ? VERDICT_PASSED : VERDICT_NOT_JUDGED, "%s",
        a.n > 0         ? "each time"
        : a.missing > 0 ? "it did not come back"
                        : "no fault ended a connection");
    if (a.missing > 0)
        judge_missing(c, &a, v);
    else if (a.n > 0 && a.max_s > c->options->limit_s)
        say(v, VERDICT_COMES_BACK, VERDICT_FOUND, "it came back %.1f s after %s; the limit is %g s", a.max_s,
            fault_names[a.longest->kind], c->options->limit_s);
    else if (c->has_sessions && c->watch->first_open_ns != 0 && c->was_there && !c->is_open)
        say(v, VERDICT_COMES_BACK, VERDICT_FOUND, "it closed its connection by itself, and had none at the end");
    else if (a.n > 0)
        say(v, VERDICT_COMES_BACK, VERDICT_PASSED, "%zu times, after %.2f s on average and %.2f s at most (%s)", a.n,
            a.sum_s / (double)a.n, a.max_s, fault_names[a.longest->kind]);
    else
        say(v, VERDICT_COMES_BACK, VERDICT_NOT_JUDGED, "no fault ended a connection");
}

/* ---- requests and points */

static void judge_requests(const struct checks *c, struct verdict *v)
{
    const struct watch *w = c->watch;
    v->figures.refused = w->wrong;
    v->figures.refused_by_state = w->wrong_state;
    v->figures.heard_bytes = w->heard_bytes;
    for (uint64_t i = 0; i < w->wrong && i < WATCH_REFUSED; i++)
        snprintf(v->figures.wrong_lines[i], sizeof v->figures.wrong_lines[i], "%s", w->refused[i]);
    if (w->wrong != 0)
        say(v, VERDICT_ASKS_RIGHT, VERDICT_FOUND, "%" PRIu64 " refused; the first: %s", w->wrong, w->refused[0]);
    else if (w->heard_bytes == 0)
        say(v, VERDICT_ASKS_RIGHT, VERDICT_NOT_JUDGED, "it asked nothing");
    else
        say(v, VERDICT_ASKS_RIGHT, VERDICT_PASSED, "%" PRIu64 " bytes; refused for the head's state: %" PRIu64,
            w->heard_bytes, w->wrong_state);
}

static void judge_scans(const struct checks *c, struct verdict *v)
{
    if (c->scans)
        say(v, VERDICT_SCANS, VERDICT_PASSED, "points came until the end");
    else if (!c->was_there || (c->has_sessions && !c->is_open))
        say(v, VERDICT_SCANS, VERDICT_NOT_JUDGED, "it was not there to start one");
    else
        say(v, VERDICT_SCANS, VERDICT_FOUND, "no points for %g s after the last fault: nothing started a scan",
            c->options->limit_s);
}

static void judge_speed(const struct checks *c, struct verdict *v)
{
    const char *why = !c->has_sessions               ? "the link does not wait"
                      : c->watch->first_open_ns == 0 ? "it did not connect"
                      : c->watch->stalls != 0        ? "the head stalled on request"
                                                     : NULL;
    if (why != NULL)
        say(v, VERDICT_KEEPS_UP, VERDICT_NOT_JUDGED, "%s", why);
    else if (v->figures.left_out != 0)
        say(v, VERDICT_KEEPS_UP, VERDICT_FOUND, "%" PRIu64 " frames were left out, since it read too slowly",
            v->figures.left_out);
    else
        say(v, VERDICT_KEEPS_UP, VERDICT_PASSED, "no frame was left out");
}

/* ---- its process */

/* A shell reports a signal of what it ran as a status above 128. */
static int signal_of(int status)
{
    if (WIFSIGNALED(status)) return WTERMSIG(status);
    return WIFEXITED(status) && WEXITSTATUS(status) > 128 ? WEXITSTATUS(status) - 128 : 0;
}

static void say_exit(const struct client *client, char *to, size_t cap)
{
    const int number = signal_of(client->status);
    const char *name = number != 0 ? sigabbrev_np(number) : NULL;
    if (name != NULL)
        snprintf(to, cap, "SIG%s", name);
    else
        snprintf(to, cap, "exit status %d", WIFEXITED(client->status) ? WEXITSTATUS(client->status) : -1);
}

static int is_crash(int number)
{
    return number == SIGSEGV || number == SIGABRT || number == SIGBUS || number == SIGILL || number == SIGFPE;
}

static void judge_process(const struct checks *c, struct verdict *v)
{
    char *how = v->figures.exit;
    say_exit(c->client, how, sizeof v->figures.exit);
    if (!c->was_there) {
        say(v, VERDICT_LIVES, VERDICT_FOUND, "it ended by itself %.2f s after its start: %s",
            s_between(c->start_ns, c->client->ended_ns), how);
        say(v, VERDICT_ENDS, VERDICT_NOT_JUDGED, "it had ended");
        return;
    }
    say(v, VERDICT_LIVES, VERDICT_PASSED, "for %.1f s", s_between(c->start_ns, c->ended_ns));
    if (c->client->had_to_be_killed)
        say(v, VERDICT_ENDS, VERDICT_FOUND, "it went on for %g s after SIGTERM, and was killed", c->options->grace_s);
    else if (is_crash(signal_of(c->client->status)))
        say(v, VERDICT_ENDS, VERDICT_FOUND, "it died after SIGTERM: %s", how);
    else
        say(v, VERDICT_ENDS, VERDICT_PASSED, "%.2f s after SIGTERM: %s", s_between(c->ended_ns, c->client->ended_ns),
            how);
}

void checks_judge(const struct checks *c, struct verdict *v)
{
    v->figures.sessions = c->has_sessions ? c->watch->n_span : 0;
    v->figures.injected = c->watch->injected;
    v->figures.connected_s =
        c->watch->first_open_ns != 0 && c->has_sessions ? s_between(c->start_ns, c->watch->first_open_ns) : (double)NAN;
    judge_connects(c, v);
    judge_absences(c, v);
    judge_requests(c, v);
    judge_scans(c, v);
    judge_speed(c, v);
    judge_process(c, v);
}

/* ---- points */

void checks_no_points(struct verdict *v, enum verdict_state state, const char *why)
{
    say(v, VERDICT_POINTS_READ, state, "%s", why);
    for (int check = VERDICT_POINTS_KNOWN; check <= VERDICT_POINTS_ONCE; check++)
        say(v, (enum verdict_check)check, VERDICT_NOT_JUDGED, "%s",
            state == VERDICT_FOUND ? "its points can't be read" : why);
}

void checks_points(struct verdict *v, const struct verdict_points *m, const double unknown[3])
{
    v->points = *m;
    say(v, VERDICT_POINTS_READ, VERDICT_PASSED, "%zu points, of %zu that were sent; %zu shots without echo", m->n,
        m->sent, m->empty);
    if (m->unknown != 0)
        say(v, VERDICT_POINTS_KNOWN, VERDICT_FOUND,
            "%zu of %zu points are not known: no pulse had them (frame: %s, within %.6g mm); the first is number %zu: "
            "%.9g %.9g %.9g",
            m->unknown, m->n, m->frame, 1e3 * m->within_m, m->first_unknown + 1, unknown[0], unknown[1], unknown[2]);
    else
        say(v, VERDICT_POINTS_KNOWN, VERDICT_PASSED, "all of them (frame: %s, within %.6g mm)", m->frame,
            1e3 * m->within_m);
    if (m->unknown > m->n / 2)
        say(v, VERDICT_POINTS_ONCE, VERDICT_NOT_JUDGED, "most of its points are unknown");
    else if (m->repeated != 0)
        say(v, VERDICT_POINTS_ONCE, VERDICT_FOUND, "%zu more than were sent", m->repeated);
    else
        say(v, VERDICT_POINTS_ONCE, VERDICT_PASSED, "none is repeated%s",
            2 * m->again < m->sent ? "" : "; but most were sent close to another one, so a repeated one can go unseen");
}
