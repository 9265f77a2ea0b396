/* SPDX-License-Identifier: MIT */
/* mEEwriteall stores the session's settings, which then outlast a power cycle. Each setting is a line, as a request in
 * CoLa-A writes it, but with decimal numbers and without the length of LocationName. Line rate, step and time server
 * are the head's, and HEAD:STORe stores them. */
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/cola.h"

static void put_lines(const struct cola *self, char *text, size_t cap)
{
    struct cola_settings s = self->set;
    uint8_t *bytes[COLA_CFG_BYTES];
    size_t n = (size_t)snprintf(text, cap, "LMDscandatacfg");
    cola_list_cfg(&s, bytes);
    for (int i = 0; i < COLA_CFG_BYTES; i++)
        n += (size_t)snprintf(text + n, cap - n, " %u", *bytes[i]);
    n += (size_t)snprintf(text + n, cap - n, " %u\nFREchoFilter %u\nLMDscandatascalefactor %u\n", s.every, s.filter,
                          s.scale);
    /* The lines are for the sessions of all links. Each link may be configured with another dialect. So a dialect is
     * stored only where it is not the one that this link is configured with. */
    if (cola_framing(self) != cola_configured_framing(self))
        n += (size_t)snprintf(text + n, cap - n, "EIHstCola %u\n", cola_framing(self));
    if (s.narrowed) n += (size_t)snprintf(text + n, cap - n, "LMPoutputRange %d %d\n", s.start_e4, s.stop_e4);
    snprintf(text + n, cap - n, "LocationName %s\n", s.location);
}

enum cola_error cola_keep(struct cola *self)
{
    char text[PROTOCOL_STORED];
    int kept = 1; /* a head without a file answers 1, too, but stores nothing */
    if (self->spec.keeps && self->spec.host.store != NULL) {
        put_lines(self, text, sizeof text);
        kept = self->spec.host.command(self->spec.host.ctx, "HEAD:STORe", NULL, 0) == 0 &&
               self->spec.host.store(self->spec.host.ctx, text) == 0;
        if (kept) strcpy(self->stored, text);
    }
    cola_put_u(&self->out, 1, (uint32_t)kept);
    return COLA_OK;
}

static int take_cfg(struct cola_settings *s, const char *at)
{
    uint8_t *bytes[COLA_CFG_BYTES];
    unsigned v;
    int n;
    cola_list_cfg(s, bytes);
    for (int i = 0; i <= COLA_CFG_BYTES; i++, at += n) {
        if (sscanf(at, " %5u%n", &v, &n) != 1 || v > (i < COLA_CFG_BYTES ? UINT8_MAX : UINT16_MAX)) return 0;
        if (i < COLA_CFG_BYTES)
            *bytes[i] = (uint8_t)v;
        else
            s->every = (uint16_t)v;
    }
    return *at == '\0';
}

/* Reads a whole number up to `most` that ends the line. Returns 1, or 0 where there is none. */
static int cola_stored_take_number(const char *at, unsigned most, unsigned *v)
{
    int n;
    return sscanf(at, " %9u%n", v, &n) == 1 && at[n] == '\0' && *v <= most;
}

/* 1: done; 0: it is no line that cola_keep writes. */
static int cola_stored_take_line(struct cola *self, const char *line)
{
    struct cola_settings *s = &self->set;
    char name[COLA_MAX_NAME];
    unsigned v;
    int n;
    if (sscanf(line, "%31[A-Za-z]%n", name, &n) != 1 || line[n] != ' ') return 0;
    const char *at = line + n;
    if (strcmp(name, "LMDscandatacfg") == 0) return take_cfg(s, at) && cola_scan_data_fits(self, s);
    if (strcmp(name, "LMPoutputRange") == 0) {
        s->narrowed = 1;
        return sscanf(at, " %9d %9d%n", &s->start_e4, &s->stop_e4, &n) == 2 && at[n] == '\0' &&
               s->start_e4 <= s->stop_e4;
    }
    if (strcmp(name, "LocationName") == 0)
        return snprintf(s->location, sizeof s->location, "%s", at + 1) < COLA_MAX_NAME;
    const int is_filter = strcmp(name, "FREchoFilter") == 0, is_scale = strcmp(name, "LMDscandatascalefactor") == 0,
              is_framing = strcmp(name, "EIHstCola") == 0;
    if (!is_filter && !is_scale && !is_framing) return 0;
    if (!cola_stored_take_number(at, is_framing ? COLA_B : 2, &v) || (is_filter && !cola_filter_fits(self, v)))
        return 0;
    if (is_filter) s->filter = (uint8_t)v;
    if (is_scale) s->scale = v;
    if (is_framing) s->framing = (uint8_t)v;
    return 1;
}

int cola_restore(struct cola *self, struct sh_err *err)
{
    char line[256];
    for (const char *at = self->stored; *at != '\0'; at += strcspn(at, "\n") + 1) {
        const size_t len = strcspn(at, "\n");
        snprintf(line, sizeof line, "%.*s", (int)len, at);
        if (len >= sizeof line || !cola_stored_take_line(self, line))
            return sh_fail(err, SH_EINPUT,
                           "head.settings_file: '%.60s' is no setting that cola stores; correct it, or remove the file",
                           line);
    }
    return SH_OK;
}
