// The page of `framestep console`: its server gives the address a token. Without one, Web Serial.

import { start } from "./app.js";
import { WebSocketLink } from "./websocket_link.js";

const token = new URLSearchParams(location.search).get("token");
const scheme = location.protocol === "https:" ? "wss" : "ws";
start(token && (() => WebSocketLink.open(`${scheme}://${location.host}/link?token=${encodeURIComponent(token)}`)));
