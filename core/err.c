#include "core/err.h"

#include <stdarg.h>
#include <stdio.h>

/* A name from a file, or a path, may have any bytes: line ends, and what a terminal takes for a command. */
static void keep_line(char *text)
{
    for (char *c = text; *c != '\0'; c++)
        if ((unsigned char)*c < ' ' || *c == 0x7f) *c = '?';
}

int sh_fail(struct sh_err *err, int code, const char *fmt, ...)
{
    if (err == NULL) return code;
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(err->text, sizeof err->text, fmt, ap);
    va_end(ap);
    keep_line(err->text);
    err->code = code;
    return code;
}

void sh_warn(const struct sh_report *report, const char *fmt, ...)
{
    if (report == NULL || report->warn == NULL) return;
    char text[512];
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(text, sizeof text, fmt, ap);
    va_end(ap);
    keep_line(text);
    report->warn(report->ctx, text);
}

void sh_progress(const struct sh_report *report, const char *what, double fraction)
{
    if (report != NULL && report->progress != NULL) report->progress(report->ctx, what, fraction);
}

int sh_stopped(const struct sh_report *report)
{
    return report != NULL && report->stop != NULL && report->stop(report->ctx);
}

int sh_fail_stopped(struct sh_err *err)
{
    return sh_fail(err, SH_ESTOPPED, "interrupted while loading; nothing ran");
}

int sh_check_stop(const struct sh_report *report, struct sh_err *err)
{
    return sh_stopped(report) ? sh_fail_stopped(err) : SH_OK;
}
