// The page of `framestep console`. Its server adds a token to the address; without a token the page uses Web Serial.

import { start } from "./app.js";
import { WebSocketLink } from "./websocket_link.js";

const token = new URLSearchParams(location.search).get("token");
const scheme = location.protocol === "https:" ? "wss" : "ws";
start(token && ((take) => WebSocketLink.open(`${scheme}://${location.host}/link?token=${encodeURIComponent(token)}${take ? "&take=1" : ""}`)));
