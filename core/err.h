/* SPDX-License-Identifier: MIT */
/* The one error scheme: 0 or a negative SH_E code, and one line of text for the user.
 *
 * A function that can fail for a reason the user can act on takes a `struct sh_err *` as its last
 * argument, fills it through sh_fail() and returns the code. The text is one line: what, where, what is
 * allowed. Nothing below main prints it. Thread: a sh_err belongs to its caller; sh_fail allocates
 * nothing. */
#ifndef CORE_ERR_H
#define CORE_ERR_H

enum sh_code {
    SH_OK = 0,
    SH_EINPUT = -1,    /* wrong usage, configuration or input file: exit status 2 */
    SH_EIO = -2,       /* the operating system or a peer failed: exit status 1 */
    SH_ENOMEM = -3,    /* no memory: exit status 1 */
    SH_EPERM = -4,     /* a permission is missing; the text says which */
    SH_ETIMEOUT = -5,  /* nothing happened in time */
    SH_ECLOSED = -6,   /* the other end is gone */
    SH_EFORMAT = -7,   /* bytes that break the protocol */
    SH_ESTATE = -8,    /* not possible in the present state */
    SH_ELOST = -9,     /* a device is not there, or not any more */
    SH_ERESET = -10,   /* a device is still there, but was reset: what was open on it is closed */
    SH_ESTOPPED = -11, /* the caller has stopped the work: exit status 1 */
};

struct sh_err {
    int code;
    char text[1024]; /* long enough for a message that lists all kinds of injected faults */
};

/* Fills err (which may be NULL) and returns code, so that `return sh_fail(err, SH_EINPUT, ...)` reads well.
 * A text too long for the buffer is cut at its end. The texts of sh_fail and sh_warn go through
 * sh_keep_line. */
int sh_fail(struct sh_err *err, int code, const char *fmt, ...) __attribute__((format(printf, 3, 4)));

/* Replaces control characters, and each byte that is part of no character in UTF-8, by question marks. Names from
 * files, and paths, may have any bytes, such as line ends and terminal commands. A format such as %.40s may cut them
 * within a character. */
void sh_keep_line(char *text);

/* Receives the reports of long work. Each member may be NULL: `rest` then receives these reports, if there is one. So a
 * member that is set to NULL silences only a report without `rest`. warn and progress are called from the thread that
 * does the work. */
struct sh_report {
    void *ctx;
    void (*warn)(void *ctx, const char *text);                      /* one line, without a newline */
    void (*progress)(void *ctx, const char *what, double fraction); /* 0..1; negative where unknown */
    /* 1: the work is to end; then it is 1 at every later call. Called from any thread of the work, and often:
     * it only reads a flag. */
    int (*stop)(void *ctx);
    const struct sh_report *rest; /* must outlive this one */
};

void sh_warn(const struct sh_report *report, const char *fmt, ...) __attribute__((format(printf, 2, 3)));
void sh_progress(const struct sh_report *report, const char *what, double fraction);

/* Whether the work is to end. report may be NULL. */
int sh_stopped(const struct sh_report *report);
/* SH_ESTOPPED, with its line of text. */
int sh_fail_stopped(struct sh_err *err);
/* SH_OK, or sh_fail_stopped where the work is to end. */
int sh_check_stop(const struct sh_report *report, struct sh_err *err);

#endif
