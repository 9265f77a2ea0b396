/* SPDX-License-Identifier: MIT */
#include "firmware_sim/command/stored.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/command/row.h"
#include "firmware_sim/command/setting.h"
#include "firmware_sim/command/step.h"
#include "firmware_sim/command/time_server.h"

static int is_stored(const struct command_device *dev, const struct command_row *row)
{
    const struct command_setting *setting = row->setting;
    if (setting == NULL) return row->act == command_server_change;
    if (setting->derived != NULL) return setting->derived == &command_step_both && dev->settings.step_udeg != 0;
    return setting->offset != offsetof(struct head_settings, station) &&
           setting->offset != offsetof(struct head_settings, frames);
}

/* Returns the value that a header's query gives. */
static const char *ask(struct command_device *dev, const char *header, struct command_result *out)
{
    char line[COMMAND_MAX_LINE + 2];
    snprintf(line, sizeof line, "%s?", header);
    command_execute(dev, 0, line, out);
    return out->reply;
}

int command_stored_text(struct command_device *dev, const struct head_settings *configured, char *text, size_t cap)
{
    const struct head_settings now = dev->settings;
    const struct command_time_server server = dev->server;
    struct command_result out, before;
    size_t n = 0;
    text[0] = '\0';
    for (const struct command_row *row = command_rows; row->header != NULL; row++) {
        if (!is_stored(dev, row)) continue;
        dev->settings = *configured;
        dev->server = dev->server_configured;
        ask(dev, row->header, &before);
        dev->settings = now;
        dev->server = server;
        if (strcmp(ask(dev, row->header, &out), before.reply) == 0) continue;
        n += (size_t)snprintf(text + n, cap - n, "%s %s\n", row->header, out.reply);
        if (n >= cap) return -1;
    }
    return 0;
}

/* ---- from the stored text back to settings */

enum { MAX_LINES = 32 };

struct lines {
    char line[MAX_LINES][COMMAND_MAX_LINE + 1];
    int is_done[MAX_LINES];
    int n;
};

static int cut_lines(const struct command_device *dev, const char *text, struct lines *lines, char *why, size_t len)
{
    for (size_t n; *text != '\0'; text += n + (text[n] == '\n')) {
        n = strcspn(text, "\n");
        if (lines->n == MAX_LINES || n > COMMAND_MAX_LINE) {
            snprintf(why, len, "allowed are %d lines of up to %d bytes", MAX_LINES, COMMAND_MAX_LINE);
            return -1;
        }
        char *line = lines->line[lines->n++]; /* all zeros */
        memcpy(line, text, n);
        const struct command_row *row = command_find_row(line, strcspn(line, " "));
        if (row == NULL || !is_stored(dev, row)) {
            snprintf(why, len, "'%.80s' is no setting that this head stores", line);
            return -1;
        }
    }
    return 0;
}

static int is_set(struct command_device *dev, const char *line, struct command_result *out)
{
    char header[COMMAND_MAX_LINE + 1];
    const size_t n = strcspn(line, " ");
    snprintf(header, sizeof header, "%.*s", (int)n, line);
    return line[n] == ' ' && strcmp(ask(dev, header, out), line + n + 1) == 0;
}

/* Tries the lines that are not done: first on `trial`, then with `set`. Returns how many were done. */
static int try_lines(struct command_device *trial, struct lines *lines, void (*set)(void *ctx, const char *line),
                     void *ctx, const char **left, struct command_result *refused)
{
    struct command_result out;
    int n = 0;
    *left = NULL;
    for (int i = 0; i < lines->n; i++) {
        if (lines->is_done[i]) continue;
        if (!is_set(trial, lines->line[i], &out)) {
            command_execute(trial, 0, lines->line[i], &out);
            if (out.error != 0) {
                *left = lines->line[i];
                *refused = out;
                continue;
            }
            set(ctx, lines->line[i]);
        }
        lines->is_done[i] = 1;
        n++;
    }
    return n;
}

int command_stored_apply(struct command_device *dev, const char *text, void (*set)(void *ctx, const char *line),
                         void *ctx, char *why, size_t len)
{
    struct command_device *trial = malloc(sizeof *trial); /* its error queue takes the refusals */
    struct lines *lines = calloc(1, sizeof *lines);
    struct command_result refused;
    const char *left = NULL;
    int rc = -1;
    snprintf(why, len, "no memory");
    if (trial != NULL && lines != NULL) {
        *trial = *dev;
        rc = cut_lines(dev, text, lines, why, len);
        while (rc == 0 && try_lines(trial, lines, set, ctx, &left, &refused) > 0)
            continue;
        if (left != NULL) {
            snprintf(why, len, "'%.80s' is refused: %.200s", left, refused.reply);
            rc = -1;
        }
    }
    free(trial);
    free(lines);
    return rc;
}
