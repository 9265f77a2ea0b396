/* SPDX-License-Identifier: MIT */
#include <glob.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "core/bytes.h"
#include "drivers/link/link.h"
#include "drivers/usb/backend.h"
#include "firmware_sim/app/studio/soak/row.h"
#include "firmware_sim/app/studio/soak/usb.h"
#include "firmware_sim/fault/fault.h"

/* Shorter delays can't be told from an enumeration on a busy machine. */
static const double SLOW_MS = 10.0, MARGIN_MS = 5.0;
/* Control requests by which libscanhead opens a device: two for its serial number, one for the session. */
enum { OPEN_REQUESTS = 3, DEVICE_LEN = 18, CONFIG_HEADER_LEN = 4, DESCRIPTORS_LEN = 4096 };

int soak_usb_is_here(const struct link_spec *spec)
{
    return spec->type == LINK_USB && spec->backend == USB_BACKEND_USBIP && spec->attach && spec->protocol == 0;
}

void soak_usb_name(struct link_spec *spec, uint32_t number)
{
    if (!soak_usb_is_here(spec) || !spec->own_serial) return;
    spec->own_serial = 0;
    snprintf(spec->serial, sizeof spec->serial, "SOAK-%ld-%u", (long)getpid(), number);
}

void soak_usb_source(const struct link_spec *spec, char *source, size_t len)
{
    snprintf(source, len, "usb:%04x:%04x:%s", (unsigned)spec->vid, (unsigned)spec->pid, spec->serial);
}

/* ---- the bytes that the configuration descriptor announces beyond those that Linux got */

static size_t read_file(const char *folder, const char *name, uint8_t *to, size_t len)
{
    char path[300];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *in = fopen(path, "r");
    if (in == NULL) return 0;
    const size_t n = fread(to, 1, len, in);
    fclose(in);
    return n;
}

static int is_serial(const char *folder, const char *serial)
{
    uint8_t text[80];
    const size_t n = read_file(folder, "serial", text, sizeof text), len = strlen(serial);
    return n == len + 1 && memcmp(text, serial, len) == 0;
}

/* Returns how many bytes are announced and not there; -1: not known. */
static int64_t excess_of(const char *serial)
{
    glob_t found;
    uint8_t d[DESCRIPTORS_LEN];
    int64_t excess = -1;
    if (glob("/sys/bus/usb/devices/*", 0, NULL, &found) != 0) return -1;
    for (size_t i = 0; i < found.gl_pathc && excess < 0; i++) {
        if (!is_serial(found.gl_pathv[i], serial)) continue;
        const size_t n = read_file(found.gl_pathv[i], "descriptors", d, sizeof d);
        if (n >= DEVICE_LEN + CONFIG_HEADER_LEN)
            excess = DEVICE_LEN + (int64_t)le_get16(d + DEVICE_LEN + 2) - (int64_t)n;
    }
    globfree(&found);
    return excess;
}

/* ---- enumerations */

void soak_usb_forget(struct soak_plugs *plugs, struct soak_row *row, const char *why)
{
    for (uint32_t i = 0; i < plugs->n; i++)
        soak_hide(&row[plugs->note[i].kind], 1, why);
    plugs->n = 0;
}

void soak_usb_plugged(struct soak_plugs *plugs, struct soak_row *row, const struct fault_note *note)
{
    if (plugs->n != 0 && plugs->note[0].number != note->number)
        soak_usb_forget(plugs, row, "it was plugged in again before a client opened it");
    if (plugs->n < SOAK_MAX_PLUGS)
        plugs->note[plugs->n++] = *note;
    else
        soak_hide(&row[note->kind], 1, "too many at a time");
}

static void judge_plug(struct soak_row *row, const struct fault_note *note, double opened_ms, int64_t excess)
{
    const int is_slow = note->kind == FAULT_SLOW_ENUMERATION;
    if (is_slow && note->for_ms < SLOW_MS)
        soak_hide(row, 1, "shorter than 10 ms");
    else if (is_slow ? opened_ms >= OPEN_REQUESTS * note->for_ms - MARGIN_MS : excess == (int64_t)note->n)
        row->noticed++;
    else
        row->missed++;
}

void soak_usb_opened(struct soak_plugs *plugs, struct soak_row *row, const char *source, double opened_ms)
{
    const char *serial = strrchr(source, ':');
    const int64_t excess = plugs->n != 0 && serial != NULL ? excess_of(serial + 1) : -1;
    for (uint32_t i = 0; i < plugs->n; i++)
        judge_plug(&row[plugs->note[i].kind], &plugs->note[i], opened_ms, excess);
    plugs->n = 0;
}
