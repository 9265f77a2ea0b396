/* SPDX-License-Identifier: MIT */
/* scanhead list: head profiles, kinds of links, scenarios of faults, and the heads that USB shows. */
#include <stdio.h>

#include "drivers/host/scanhead.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/config/load.h"
#include "firmware_sim/config/reference.h"

enum { MAX_HEADS = 64 };

static void print_head(const struct scanhead_usb_head *head)
{
    printf("%-32s bus %d device %d", head->source, head->bus, head->device);
    if (head->speed_bit_s > 0.0) printf(", %g Mbit/s", 1e-6 * head->speed_bit_s);
    if (head->maker[0] != '\0' || head->product[0] != '\0') printf(", %s %s", head->maker, head->product);
    printf(head->problem[0] != '\0' ? "; %s\n" : "\n", head->problem);
}

static void list_usb(void)
{
    static struct scanhead_usb_head head[MAX_HEADS];
    char why[256];
    int n = scanhead_list_usb(head, MAX_HEADS, why, sizeof why);
    if (n < 0)
        printf("heads on USB: %s\n", why); /* no failure: a system without USB has the rest of the list */
    else
        puts(n == 0 ? "heads on USB: none" : "heads on USB:");
    for (int i = 0; i < n && i < MAX_HEADS; i++)
        print_head(&head[i]);
    if (n > MAX_HEADS) printf("and %d more\n", n - MAX_HEADS);
}

static int list_run(int argc, char **argv)
{
    struct app_input in;
    struct sh_err err = {0};
    char scenarios[512];
    int status = app_parse(&app_list, argc, argv, &in, NULL);
    if (status != APP_GO_ON) return status;
    /* All else is known without profiles. */
    status = config_list_profiles(NULL, stdout, &err) < 0 ? app_fail(&err) : APP_OK;
    puts("links: pty (virtual serial port), tcp, udp, usb (usbip, usbredir, functionfs), web (page), file, null");
    printf("protocols:");
    for (int id = 0; id < PROTOCOL_N; id++)
        printf("%s %s", id > 0 ? "," : "", protocol_ops_get((enum protocol_id)id)->name);
    puts("");
    config_name_scenarios(scenarios, sizeof scenarios);
    printf("scenarios: %s\n", scenarios);
    list_usb();
    return status;
}

static const struct app_option OPTIONS[] = {OPTION_END};

const struct app_command app_list = {
    .name = "list",
    .summary = "head profiles, kinds of links, scenarios, and the heads that USB shows",
    .options = OPTIONS,
    .notes =
        "Profiles are searched in the folder $SCANHEAD_HEADS, else in ../share/scanhead/heads or ../config/heads from\n"
        "the program's folder, else in config/heads from the working directory.\n"
        "\n"
        "For each profile it prints how its pulses are arranged, the width of its beam and how its maker defines it,\n"
        "noise and accuracy of its ranges, the protocols that support it, and its pulse rates. With each rate it "
        "prints\n"
        "the pulses that fall into the field of view, echoes per pulse, smallest range and reach. Last are the "
        "figures\n"
        "by grade: from a data sheet, quoted, assumed (config/heads/README.md explains these).\n"
        "\n"
        "Heads on USB are those with this project's interface. A head with the USB identity of another maker's device\n"
        "(links[].protocol scip, cola) is not among them.\n",
    .run = list_run,
};
