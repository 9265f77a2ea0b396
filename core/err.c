#include "core/err.h"

#include <stdarg.h>
#include <stdio.h>

int sh_fail(struct sh_err *err, int code, const char *fmt, ...)
{
    if (err == NULL) return code;
    va_list ap;
    va_start(ap, fmt);
    vsnprintf(err->text, sizeof err->text, fmt, ap);
    va_end(ap);
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
