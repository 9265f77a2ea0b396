/* SPDX-License-Identifier: MIT */
/* Keys that only some kinds of link, back end or platform have (their rows say so), and what a link of a kind needs. */
#include <stdio.h>
#include <string.h>

#include "drivers/usb/backend.h"
#include "firmware_sim/config/check_links.h"
#include "firmware_sim/config/check_places.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/table/given.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"

/* Lists the keys of the section that the kind has. */
static void list_keys(const struct cfg_reader *rd, const char *section, int kind, char *list, size_t len)
{
    list[0] = '\0';
    for (size_t i = 0; i < rd->table.n; i++) {
        const struct cfg_key *key = &rd->table.keys[i];
        const char *word = cfg_word_below(key->path, section);
        if (word != NULL && (key->of == 0 || (key->of & CFG_KIND(kind)) != 0)) cfg_list_add(list, len, word);
    }
}

/* Reports each key of the section that is given although a kind of link, back end or platform does not have it. `name`
 * is that of the kind, in errors. Returns whether there is none. */
static int check_owned(struct cfg_reader *rd, const char *section, uint32_t item, int is_backend, int kind,
                       const char *name)
{
    char allowed[CFG_ALLOWED_MAX] = "without it";
    int fits = 1;
    if (!is_backend) list_keys(rd, section, kind, allowed, sizeof allowed);
    for (size_t i = 0; i < rd->table.n; i++) {
        const struct cfg_key *key = &rd->table.keys[i];
        const unsigned kinds = is_backend ? key->of_backend : key->of;
        if (kinds == 0 || (kinds & CFG_KIND(kind)) || cfg_word_below(key->path, section) == NULL) continue;
        if (!cfg_is_item_given(rd, key->path, item)) continue;
        cfg_fail_item(rd, key->path, item, "%s has no such key; allowed %s", name, allowed);
        fits = 0;
    }
    return fits;
}

static void check_usb_link(struct cfg_reader *rd, const struct config *cfg, struct link_spec *link, uint32_t i)
{
    char owner[64];
    const int has_port = cfg_is_item_given(rd, "links[].port", i),
              has_address = cfg_is_item_given(rd, "links[].address", i);
    const int is_redir = link->backend == USB_BACKEND_USBREDIR, has_path = cfg_is_item_given(rd, "links[].path", i);
    cfg_set_usb_identity(rd, cfg, link, i);
    if (link->backend == USB_BACKEND_USBIP && !has_port) link->port = USB_BACKEND_USBIP_PORT;
    if (!CFG_ITEM_SOUND(rd, i, "links[].backend")) return;
    snprintf(owner, sizeof owner, "the back end %s", cfg_word(rd, "links[].backend", link->backend));
    if (!check_owned(rd, "links[]", i, 1, link->backend, owner)) return;
    if (has_path && (has_port || has_address))
        cfg_fail_item(rd, "links[].path", i, "both a path and a port or address; allowed one of them");
    else if (link->backend == USB_BACKEND_USBIP && link->attach && (has_port || has_address))
        cfg_fail_item(rd, "links[].attach", i, "an attached device does not listen; allowed without port and address");
    else if (is_redir && !has_path && !has_port)
        cfg_fail_item(rd, "links[].backend", i, "usbredir needs a path or a port; allowed with one of them");
    else if (is_redir && link->attach && !has_path && link->port == 0)
        cfg_fail_item(rd, "links[].port", i, "0, but the head must connect to this port; allowed 1 to 65535");
}

/* Returns whether both listen on one port of one address; 0.0.0.0 is all addresses. */
static int listens_as(const struct link_spec *a, const struct link_spec *b)
{
    const unsigned tcp = CFG_KIND(LINK_TCP) | CFG_KIND(LINK_WEB);
    const char *at[] = {a->address[0] != '\0' ? a->address : "127.0.0.1",
                        b->address[0] != '\0' ? b->address : "127.0.0.1"};
    return (CFG_KIND(a->type) & tcp) != 0 && (CFG_KIND(b->type) & tcp) != 0 && a->port != 0 && a->port == b->port &&
           (strcmp(at[0], at[1]) == 0 || strcmp(at[0], "0.0.0.0") == 0 || strcmp(at[1], "0.0.0.0") == 0);
}

static void check_link(struct cfg_reader *rd, struct config *cfg, uint32_t i)
{
    struct link_spec *link = &cfg->link[i];
    char owner[64];
    if (!CFG_ITEM_SOUND(rd, i, "links[].type")) return;
    snprintf(owner, sizeof owner, "a %s link", cfg_word(rd, "links[].type", (int)link->type));
    if (!check_owned(rd, "links[]", i, 0, (int)link->type, owner)) return;
    if (link->type == LINK_FILE && link->path[0] == '\0')
        cfg_fail_item(rd, "links[].path", i, "missing; a file link requires the path of the file to write");
    for (uint32_t k = 0; k < i; k++) {
        if (link->path[0] != '\0' && strcmp(cfg->link[k].path, link->path) == 0)
            cfg_fail_item(rd, "links[].path", i, "links[%u] has the same path; allowed a path of its own", k);
        if (listens_as(link, &cfg->link[k]) && CFG_ITEM_SOUND(rd, k, "links[].type", "links[].port"))
            cfg_fail_item(rd, "links[].port", i, "links[%u] listens on the same port; allowed a port of its own, or 0",
                          k);
    }
    if (link->type == LINK_USB) check_usb_link(rd, cfg, link, i);
    if (link->type == LINK_UDP && link->port == 0 && CFG_ITEM_SOUND(rd, i, "links[].port"))
        cfg_fail_item(rd, cfg_is_item_given(rd, "links[].port", i) ? "links[].port" : "links[].type", i,
                      "a udp link needs the port of its receiver; allowed 1 to 65535");
}

void cfg_check_links(struct cfg_reader *rd, struct config *cfg)
{
    for (uint32_t i = 0; i < cfg->n_links; i++)
        check_link(rd, cfg, i);
}

int cfg_check_platform_keys(struct cfg_reader *rd, const struct config_platform *p)
{
    char owner[64];
    snprintf(owner, sizeof owner, "a %s platform", cfg_word(rd, "platform.kind", (int)p->kind));
    return check_owned(rd, "platform", 0, 0, (int)p->kind, owner);
}
